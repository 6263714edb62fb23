"""What is built is what works: sdist, the wheel made of it, installed by itself and used from an empty folder."""

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import icmj

ROOT = Path(__file__).resolve().parents[1]
pytestmark = pytest.mark.slow


def say(*words: object, cwd: Path | None = None, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a program as somebody would who knows nothing of this checkout."""
    hidden = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "PYTHONDONTWRITEBYTECODE")
    environment = {key: value for key, value in os.environ.items() if key not in hidden} | more
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> tuple[Path, Path]:
    """The sdist, and the wheel built from it."""
    out = tmp_path_factory.mktemp("built")
    say(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, ROOT)
    (sdist,), (wheel,) = out.glob("*.tar.gz"), out.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory, request) -> Path:
    """The folder of programs of an environment with the wheel; what it needs is lent, or with an option installed."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False)
    alone = request.config.getoption("--from-nothing")
    say(sys.executable, "-m", "pip", "--python", place / "bin" / "python", "install", "-q",
        *([] if alone else ["--no-deps"]), built[1])  # fmt: skip
    if not alone:
        # a path in a .pth is searched for modules; editable installs of the lender are not among them
        there = sysconfig.get_path("purelib", vars={"base": str(place)})
        (Path(there) / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return place / "bin"


def test_version_stands_in_one_place(built):
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" not in settings["project"]
    for file in built:
        assert file.name.startswith(f"icmj-{icmj.__version__}")
    assert f"\nversion: {icmj.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {icmj.__version__} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_nothing_is_missing_and_nothing_too_much(built):
    listed = subprocess.run(["git", "-C", ROOT, "ls-files"], capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a checkout of git")
    tracked = {name for name in listed.stdout.splitlines() if not name.startswith((".ci/", ".git"))}
    with tarfile.open(built[0]) as sdist:
        held = {name.partition("/")[2] for name in sdist.getnames()}
    shelves = ("models", "runs", "sweeps", "experiments", "families")
    assert tracked - {f"icmj/shipped/{shelf}" for shelf in shelves} <= held
    data = {
        f"icmj/shipped/{name}"
        for name in tracked
        if name.startswith(("models/", "runs/", "sweeps/", "experiments/", "families/"))
    }
    assert data <= held
    wheel = {name for name in zipfile.ZipFile(built[1]).namelist() if ".dist-info/" not in name}
    assert wheel == {name for name in held if name.startswith("icmj/") and (ROOT / name).is_file()}


def test_a_newcomer_s_first_minutes_from_an_empty_folder(installed, tmp_path):
    home = installed.parent.resolve()
    assert say(installed / "icmj", "--version").stdout == f"icmj {icmj.__version__}\n"
    where = say(installed / "python", "-c", "import icmj; print(icmj.__file__)", cwd=tmp_path).stdout
    assert home in Path(where).resolve().parents
    found = json.loads(say(installed / "icmj", "analyse", "three-link-0.9", "--json", cwd=tmp_path).stdout)
    assert found["delta_crit"] == pytest.approx(0.7594, abs=5e-5)
    assert not list(tmp_path.iterdir())
    # interpreted, short: nothing is compiled for it
    quick = ("simulation.duration=2", "study.growth_points=0", "study.attractor_starts=0")
    options = [word for change in (*quick, "study.law_q_t=[]") for word in ("--set", change)]
    study = ("study", "simple-0.8", "--jobs", "1", *options)
    shown = say(installed / "icmj", *study, cwd=tmp_path, ICMJ_INTERPRETED="1").stdout
    assert "2 logs" in shown
    assert {path.name for path in (tmp_path / "runs" / "out").iterdir()} >= {
        "report.html", "summary.json", "simple-0.8.linear.rrd", "simple-0.8.mujoco.rrd"
    }  # fmt: skip


def test_the_whole_study_from_nothing(installed, tmp_path, request):
    if not request.config.getoption("--from-nothing"):
        pytest.skip("takes minutes, and a package index; pytest --from-nothing does it")
    say(installed / "icmj", "study", cwd=tmp_path)
    summary = json.loads((tmp_path / "runs" / "out" / "summary.json").read_text(encoding="utf-8"))
    assert len(summary) == 22
    assert {entry["case"] for entry in summary} == {path.stem for path in (ROOT / "runs").glob("*.toml")}


def test_a_notebook_of_the_gallery_runs_outside_the_checkout(installed, tmp_path):
    """A notebook knows no file of its own; it found the shipped cases beside that alone."""
    run = "import sys; source = open(sys.argv.pop(1)).read(); exec(compile(source, 'notebook', 'exec'))"
    file = ROOT / "examples" / "lean.py"
    done = say(installed / "python", "-c", run, file, cwd=tmp_path, MPLBACKEND="agg")
    assert "-26.95 N m hold the lean" in done.stdout

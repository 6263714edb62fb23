"""Every picture of README and documentation, made from the present code.

``python docs/draw.py`` makes all of them; ``python docs/draw.py panels sway`` some; ``python docs/draw.py --outdated``
those whose inputs or drawing code have changed since. Sweeps, experiments and runs are kept in ``docs/build/pictures``,
so that what was interrupted is resumed. ``docs/pictures/manifest.json`` says of every picture from what it was drawn;
``tests/test_pictures.py`` compares it with what is shown. Pictures of the viewer need a software renderer (Debian's
mesa-vulkan-drivers), and pictures of pages need Chromium.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import runpy
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
SHOWN, WORK = DOCS / "pictures", DOCS / "build" / "pictures"
MANIFEST = SHOWN / "manifest.json"
sys.path[:0] = [str(ROOT), str(DOCS), str(DOCS / "_ext")]

import concept  # noqa: E402
import moving  # noqa: E402
from figure_style import figure_style  # noqa: E402

import icmj  # noqa: E402
from icmj.cli import main as command_line  # noqa: E402


@dataclass(frozen=True)
class Picture:
    """A picture of a page.

    Attributes:
        draw: writes it to the path.
        inputs: files and folders of the repository from which it is drawn; a change of one makes it outdated.
    """

    draw: Callable[[Path], None]
    inputs: tuple[str, ...]


def icmj_command(*words: str) -> None:
    """Run a command of icmj.

    Raises:
        SystemExit: if it fails.
    """
    status = command_line.main(list(words))
    if status:
        raise SystemExit(f"icmj {' '.join(words)} failed")


def example(name: str, *words: str) -> Picture:
    """The figure at the end of an example, which is run with these arguments."""

    def draw(to: Path) -> None:
        from matplotlib import pyplot as plt

        script, before = ROOT / "examples" / f"{name}.py", sys.argv
        sys.argv = [str(script), *words]
        with mpl.rc_context(figure_style()):
            try:
                runpy.run_path(str(script), run_name="__main__")
            finally:
                sys.argv = before
            plt.gcf().savefig(to, dpi=130, metadata={"Software": None})
            plt.close("all")

    return Picture(draw, (f"examples/{name}.py", "docs/_ext/figure_style.py", "icmj/report/style.py"))


def experiment(name: str) -> Picture:
    """The figure of ``icmj experiment NAME``."""
    kind = icmj.load_experiment(name).kind

    def draw(to: Path) -> None:
        icmj_command("experiment", name, "--out", str(WORK / name), "-q")
        shutil.copyfile(WORK / name / "figure.png", to)

    return Picture(
        draw,
        (f"experiments/{name}.toml", f"icmj/study/kinds/{kind}.py", "icmj/report/findings.py", "icmj/report/style.py"),
    )


def sweep(name: str, panel: str, *columns: str, size: tuple[float, float] = (7.0, 5.0)) -> Picture:
    """A map of ``icmj sweep NAME``, drawn by a function of ``icmj.plots``."""

    def draw(to: Path) -> None:
        from matplotlib import pyplot as plt

        icmj_command("sweep", name, "--out", str(WORK / name), "-q")
        with icmj.plots.style(width=170, height=170 * size[1] / size[0], size=9):
            figure, axes = plt.subplots(layout="constrained")
            getattr(icmj.plots, panel)(axes, icmj.read_sweep(WORK / name), *columns)
            if panel == "validity":
                scale = figure.colorbar(axes.collections[0], ax=axes, label="relative error of the interval")
                scale.ax.yaxis.set_major_formatter(lambda at, _: f"$10^{{{at:.0f}}}$")
            figure.savefig(to, dpi=160, metadata={"Software": None})
            plt.close(figure)

    return Picture(
        draw,
        (
            f"sweeps/{name}.toml",
            *(f"icmj/report/{part}.py" for part in ("maps", "map_grid", "interval_curve", "style")),
        ),
    )


def follow(run: str, parameter: str, to: float, **options: object) -> icmj.cycle.Branch:
    """A branch of cycles of a shipped case, on the engine unless another plant is given."""
    return icmj.follow(icmj.load_run(run), parameter, to, **{"plant": "mujoco", **options})  # type: ignore[arg-type]


def branches(make: Callable[[], tuple[list[icmj.cycle.Branch], list[icmj.cycle.Branch]]]) -> Picture:
    """The figure of some branches, above the branches of the linear plant."""

    def draw(to: Path) -> None:
        from icmj.report import style
        from icmj.report.branch import branch_figure

        found, linear = make()
        with style.apply():
            branch_figure(found, linear).savefig(to, dpi=150, metadata={"Software": None})

    return Picture(
        draw, ("runs/simple-1.7.toml", "runs/three-link-1.1.toml", "icmj/report/branch.py", "icmj/report/style.py")
    )


def pendulum() -> tuple[list[icmj.cycle.Branch], list[icmj.cycle.Branch]]:
    """The pendulum's cycles along b: on both sides of 1, and what is born."""
    up = follow("simple-1.7", "b", 2.9, start_at=1.2)
    born = [icmj.branch_off(up, special) for special in up.specials if special.kind == "symmetry breaking"]
    return (
        [
            up,
            *born,
            follow("simple-1.7", "b", 1.0, start_at=1.2),
            follow("simple-0.8", "b", 0.3),
            follow("simple-0.8", "b", 1.0),
        ],
        [follow("simple-1.7", "b", 2.9, start_at=1.2, plant="linear"), follow("simple-0.8", "b", 0.3, plant="linear")],
    )


def three_link() -> tuple[list[icmj.cycle.Branch], list[icmj.cycle.Branch]]:
    """The person's cycles along b: on both sides of 1, and what is born."""
    up = follow("three-link-1.1", "b", 2.5)
    born = [icmj.branch_off(up, special) for special in up.specials if special.kind == "symmetry breaking"]
    return (
        [
            up,
            *born,
            follow("three-link-1.1", "b", 1.0),
            follow("three-link-0.9", "b", 0.57),
            follow("three-link-0.9", "b", 1.0),
        ],
        [
            follow("three-link-1.1", "b", 2.5, plant="linear"),
            follow("three-link-0.9", "b", 0.57, plant="linear"),
        ],
    )


def threshold() -> tuple[list[icmj.cycle.Branch], list[icmj.cycle.Branch]]:
    """The person's cycles along the threshold."""
    options = {"start_at": 1e-4}
    return [follow("three-link-0.9", "q_t", 1.0, **options)], [
        follow("three-link-0.9", "q_t", 1.0, plant="linear", **options)
    ]


def draw_panels(to: Path) -> None:
    """The six panels of a case."""
    case = icmj.load_run("three-link-0.9")
    runs = [icmj.run_case(case, plant, study=True) for plant in ("linear", "mujoco")]
    icmj.plots.panels(*runs).savefig(to, dpi=130, metadata={"Software": None})


def draw_sway(to: Path) -> None:
    """A person's recording: path, diffusion, spectrum."""
    from matplotlib import pyplot as plt

    recording = icmj.read_series(ROOT / "examples" / "standing.csv", rate=100.0)
    sway = icmj.measure_sway(recording)
    with icmj.plots.style(width=172, height=62, size=8):
        figure, axes = plt.subplots(1, 3, layout="constrained")
        for panel, draw in zip(
            axes, (icmj.plots.sway_path, icmj.plots.sway_diffusion, icmj.plots.sway_spectrum), strict=True
        ):
            draw(panel, sway)
        figure.savefig(to, dpi=160, metadata={"Software": None})
        plt.close(figure)


def draw_cycle(to: Path) -> None:
    """The orbit that theory predicts, and those of both plants on it."""
    from matplotlib import pyplot as plt

    case = icmj.load_run("three-link-0.9")
    runs = [icmj.run_case(case, plant) for plant in ("linear", "mujoco")]
    with icmj.plots.style(width=110, height=82, size=9):
        figure, axes = plt.subplots(layout="constrained")
        icmj.plots.phase(axes, *runs)
        figure.savefig(to, dpi=160, metadata={"Software": None})
        plt.close(figure)


def draw_muscles(to: Path) -> None:
    """The critical interval against the time constant of muscles that the controller knows, or does not know."""
    import numpy as np
    from matplotlib import pyplot as plt

    constants = np.linspace(0.0, 0.1, 21)
    with icmj.plots.style(width=110, height=82, size=9):
        figure, axes = plt.subplots(layout="constrained")
        for name, colour in (("simple-0.8", "#0072b2"), ("three-link-0.9", "#d55e00")):
            run = icmj.load_run(name)
            for table, words, dash in (
                ("assumed", "known to the controller", "-"),
                ("actual", "unknown", (0, (4, 1.6))),
            ):
                found = []
                for constant in constants:
                    lag = {f"{table}.activation.order": 1, f"{table}.activation.time_constant": float(constant)}
                    prediction = icmj.prepare(run.with_(**lag) if constant else run).prediction
                    found.append(prediction.delta_crit if prediction.cycle else np.nan)
                axes.plot(1000 * constants, found, color=colour, linestyle=dash, label=f"{run.case.title}: {words}")
        axes.set(
            xlabel="time constant of the muscles (ms)", ylabel=r"$\Delta_{crit}$ (s)", xlim=(0, 100), ylim=(0, None)
        )
        figure.legend(loc="outside upper left", fontsize=8)
        figure.savefig(to, dpi=160, metadata={"Software": None})
        plt.close(figure)


def photograph(page: Path, to: Path, wide: int, high: int, wait: int = 4000) -> None:
    """The first screen of a page, by Chromium.

    Raises:
        SystemExit: if there is none.
    """
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit(f"{to.name}: Chromium is needed to draw it, and is not there")
    with tempfile.TemporaryDirectory() as profile:
        subprocess.run(
            [
                browser,
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--hide-scrollbars",
                f"--user-data-dir={profile}",
                f"--window-size={wide},{high}",
                f"--virtual-time-budget={wait}",
                f"--screenshot={to}",
                page.as_uri(),
            ],
            check=True,
            capture_output=True,
        )
    shrink(to)


def crop(path: Path, *, above: int) -> None:
    """Cut rows off a picture."""
    from PIL import Image

    with Image.open(path) as image:
        image.crop((0, above, *image.size)).save(path)


def shrink(path: Path) -> None:
    """Write a picture of a screen with 256 colours."""
    from PIL import Image

    with Image.open(path) as image:
        image.convert("RGB").quantize(256).save(path, optimize=True)


def draw_report(to: Path) -> None:
    """The first screen of the study's report."""
    study = WORK / "study"
    if not (study / "report.html").exists():
        icmj_command("study", "--out", str(study), "-q")
    icmj_command("report", *map(str, sorted(study.glob("*.rrd"))), "--out", str(study / "report.html"), "-q")
    photograph(study / "report.html", to, 1240, 830)


def draw_live(to: Path) -> None:
    """The live page of the three-link person."""
    page = WORK / "live.html"
    page.parent.mkdir(parents=True, exist_ok=True)
    icmj.build_live(icmj.prepare(icmj.load_run("three-link-0.9")), page)
    photograph(page, to, 1180, 800, wait=60000)


def viewer(make: Callable[[Path], Path], time: float, inputs: tuple[str, ...]) -> Picture:
    """A picture of a log in the viewer."""

    def draw(to: Path) -> None:
        log = make(WORK)
        icmj_command("replay", str(log), "--screenshot", str(to), "--time", str(time), "-q")
        crop(to, above=36)  # the viewer's menu
        shrink(to)

    return Picture(
        draw, (*inputs, *(f"icmj/log/{name}.py" for name in ("blueprint", "palette", "phase_plane", "figure")))
    )


def _log(work: Path) -> Path:
    icmj_command("run", "three-link-0.9", "--plant", "mujoco", "--out", str(work), "-q")
    return work / "three-link-0.9.mujoco.rrd"


def _moving(still: bool) -> Picture:
    return Picture(
        lambda to: moving.draw_moving(_log(WORK), to, still),
        ("docs/moving.py", "runs/three-link-0.9.toml", "models/three_link.xml"),
    )


def _branch_log(work: Path) -> Path:
    icmj_command("continue", "three-link-1.1", "--parameter", "b", "--to", "2.5", "--out", str(work), "-q")
    return work / "three-link-1.1.b.mujoco.rrd"


def _concept(shades: concept.Shades, narrow: bool) -> Picture:
    return Picture(
        lambda to: to.write_text(concept.concept(shades, narrow=narrow), encoding="utf-8") and None,
        ("docs/concept.py", "runs/simple-0.8.toml"),
    )


_PANELS = (*(f"axes/{name}" for name in ("eigenvalues", "outputs", "phase", "intervals", "modes")), "sheet", "style")
PICTURES: dict[str, Picture] = {
    "concept-light.svg": _concept(concept.LIGHT, False),
    "concept-dark.svg": _concept(concept.DARK, False),
    "concept-narrow-light.svg": _concept(concept.LIGHT, True),
    "concept-narrow-dark.svg": _concept(concept.DARK, True),
    "moving.gif": _moving(still=False),
    "moving-still.png": _moving(still=True),
    "cycle.png": Picture(
        draw_cycle,
        ("runs/three-link-0.9.toml", "models/three_link.xml", "icmj/report/axes/phase.py", "icmj/report/style.py"),
    ),
    "muscles.png": Picture(
        draw_muscles,
        ("runs/three-link-0.9.toml", "runs/simple-0.8.toml", "models/three_link.xml", "models/pendulum.xml"),
    ),
    "panels.png": Picture(
        draw_panels,
        ("runs/three-link-0.9.toml", "models/three_link.xml", *(f"icmj/report/{part}.py" for part in _PANELS)),
    ),
    "report.png": Picture(
        draw_report,
        (
            "runs",
            "icmj/report/overview.py",
            "icmj/report/templates/first.html.j2",
            "icmj/report/templates/style.css",
            "icmj/report/style.py",
        ),
    ),
    "live.png": Picture(
        draw_live,
        (
            "runs/three-link-0.9.toml",
            "icmj/report/templates/live.html.j2",
            "icmj/report/templates/live.css",
            "icmj/report/templates/live.js",
        ),
    ),
    "replay.png": viewer(_log, 12.0, ("runs/three-link-0.9.toml", "models/three_link.xml")),
    "sway.png": Picture(draw_sway, ("examples/standing.csv", "icmj/report/sway_figures.py", "icmj/report/style.py")),
    "people.png": example("sway"),
    "masquerade.png": example("masquerade"),
    "attraction.png": example("attraction"),
    "delay.png": example("delay", "--points", "25"),
    "rigid-person.png": example("rigid_person"),
    "deciding.png": example("deciding", "--people", "30", "--trials", "4"),
    "validity.png": sweep("validity", "validity", "b", "q_t", size=(10.0, 6.2)),
    "delta_crit.png": sweep("delta_crit", "critical_interval", "b", size=(10.0, 5.4)),
    "basins.png": sweep("basins", "basins", "angle", "rate", size=(10.0, 7.3)),
    "cycles-pendulum.png": branches(pendulum),
    "cycles-three-link.png": branches(three_link),
    "cycles-threshold.png": branches(threshold),
    "cycles-viewer.png": viewer(_branch_log, 20.0, ("runs/three-link-1.1.toml", "models/three_link.xml")),
    **{
        f"{name}.png": experiment(name)
        for name in (
            "double-step",
            "double-step-joystick",
            "double-step-head",
            "intersection-point",
            "remnant",
            "perturbed-stance",
            "standing",
        )
    },
}


def digest(paths: Iterable[str]) -> str:
    """SHA-256 of files of the repository, and of all files in folders, with their names."""
    files: list[Path] = []
    for path in map(ROOT.joinpath, paths):
        files += (
            [path] if path.is_file() else [each for each in path.rglob("*") if each.suffix in (".py", ".toml", ".j2")]
        )
    sums = hashlib.sha256()
    for file in sorted(files):
        text = file.read_bytes().replace(b"\r\n", b"\n")
        sums.update(f"{file.relative_to(ROOT).as_posix()}\n{hashlib.sha256(text).hexdigest()}\n".encode())
    return sums.hexdigest()


def manifest() -> dict[str, dict[str, str]]:
    """What is known of the pictures that are shown."""
    return dict(json.loads(MANIFEST.read_text(encoding="utf-8"))) if MANIFEST.exists() else {}


def outdated() -> list[str]:
    """Pictures that are not there, or whose inputs or drawing code have changed."""
    known = manifest()
    return [
        name
        for name, picture in PICTURES.items()
        if not (SHOWN / name).exists() or known.get(name, {}).get("inputs") != digest(picture.inputs)
    ]


def draw(names: Iterable[str]) -> None:
    """Make these pictures, and note from what."""
    WORK.mkdir(parents=True, exist_ok=True)
    for name in names:
        print(name, flush=True)
        PICTURES[name].draw(SHOWN / name)
        picture = hashlib.sha256((SHOWN / name).read_bytes()).hexdigest()
        known = {each: of for each, of in manifest().items() if each in PICTURES}
        known[name] = {"inputs": digest(PICTURES[name].inputs), "picture": picture}
        MANIFEST.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Draw what the command line names."""
    parser = argparse.ArgumentParser(description="Make the pictures of README and documentation.")
    parser.add_argument("names", nargs="*", help="pictures (default: all)")
    parser.add_argument("--outdated", action="store_true", help="only those whose inputs have changed since")
    given = parser.parse_args()
    names = [name if "." in name else f"{name}.png" for name in given.names]
    unknown = [name for name in names if name not in PICTURES]
    if unknown:
        parser.error(f"no picture {unknown[0]}; there are {', '.join(PICTURES)}")
    draw(outdated() if given.outdated else names or PICTURES)


if __name__ == "__main__":
    main()

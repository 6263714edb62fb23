"""The shelves: a thing is one file and one line of a list; ``python -m tests.additions`` adds and takes away.

In a copy of the package, a new file and its line add a thing to each shelf, which then works from a run file on and is
in the JSON Schema; and each shipped thing is taken away, file and line, after which the rest imports, reads its files,
and runs.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Shelf:
    """One shelf.

    Attributes:
        folder: its package, from ``icmj/`` on.
        name: name of the file that is added.
        source: that file.
        works: a program that succeeds if the added thing works.
        refused: a program that succeeds if what is malformed is refused in one line; empty where no user enters one.
        rest: a program that succeeds if the package works without the things ``sys.argv[1:]``.
    """

    folder: str
    name: str
    source: str
    works: str
    refused: str
    rest: str


READ_REST = """
import sys, icmj
from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.study.file_kinds import json_schema
from icmj.work.shipped import RUNS
gone = sys.argv[1:]
json_schema("run")
refused = []
for name, path in RUNS.files.items():
    try:
        icmj.load_run(path)
    except IcmjError as error:
        assert "kind" in str(error) or any(one in str(error) for one in gone), error
        refused.append(name)
plain = icmj.load_run("simple-0.8")
short = {"simulation.duration": 1.0, "simulation.timestep": None, "analysis.delta_max": 2.0}
"""
RUN_REST = """
case = icmj.prepare(plain.with_(**short))
assert len(icmj.simulate(case, "linear").t) > 50
assert len(refused) < 0.8 * len(RUNS.files), refused
"""

SHAPES = Shelf(
    "runfile/shapes",
    "triangle",
    '''"""A triangle: up to a size and back, linearly."""

from __future__ import annotations

from typing import Literal

import numpy as np

from icmj.base.array import Array, Finite, Positive
from icmj.controller.setpoint import polygon
from icmj.runfile.place import PlaceTable
from icmj.runfile.table import keys_of
from icmj.runfile.target import TargetTable
from icmj.simulation.sources import Sampled, Source


@keys_of(Sampled, without=("values", "start"))
class TriangleTable(PlaceTable):
    """A triangle on an input."""

    kind: Literal["triangle"]
    size: Finite
    """Height [unit of the disturbed signal]."""
    points: Positive = 3.0
    """Points of the grid on each side."""

    def source(self) -> Source:
        up = np.linspace(0.0, self.size, int(self.points) + 1)
        return self.make_source(Sampled, values=(*up.tolist(), *up[-2::-1].tolist()))


class TriangleSetpoint(TargetTable):
    """A triangle that is followed."""

    kind: Literal["triangle"]
    size: Finite
    """Height [unit of the output]."""
    width: Positive
    """Duration [s]."""

    def terms(self, end: float) -> Array:
        return polygon(self.start + self.width * np.array([0.0, 0.5, 1.0]), [0.0, self.size, 0.0])


DISTURBANCE, SETPOINT = TriangleTable, TriangleSetpoint
''',
    """
import json, icmj
import numpy as np
from icmj.study.file_kinds import json_schema
run = icmj.load_run("simple-0.8").with_(**{
    "simulation.duration": 1.0, "simulation.disturbance": [{"kind": "triangle", "input": "torque", "size": 0.3}],
    "setpoint": [{"kind": "triangle", "output": "angle", "size": 0.2, "width": 0.4, "start": 0.1}]})
case = icmj.prepare(run)
simulation = icmj.simulate(case, "linear")
t = simulation.t
np.testing.assert_allclose(simulation.r[:, 0], np.interp(t, [0.1, 0.3, 0.5], [0.0, 0.2, 0.0]), atol=1e-12)
np.testing.assert_allclose(simulation.pushed[:, 0], np.interp(t, [0.0, 0.03, 0.06], [0.0, 0.3, 0.0]), atol=1e-12)
schema = json_schema("run")["$defs"]
assert schema["TriangleTable"]["properties"]["points"]["description"] == "Points of the grid on each side."
assert schema["TriangleSetpoint"]["properties"]["width"]["description"] == "Duration [s]."
""",
    """
import icmj
from icmj.errors import RunFileError
run = icmj.load_run("simple-0.8")
for changes, words in (
    ({"simulation.disturbance": [{"kind": "triangle", "input": "torque"}]}, "disturbance[0].size is missing"),
    ({"setpoint": [{"kind": "triangle", "output": "angle", "size": 1.0, "width": -1.0}]}, "must be greater than 0"),
    ({"setpoint": [{"kind": "triangel", "output": "angle"}]}, "did you mean triangle?"),
):
    try:
        run.with_(**changes)
    except RunFileError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(changes)
""",
    READ_REST
    + """
for kind in ["a:b" if one.startswith("own_") else one.replace("_", "-") for one in gone]:
    for key, where in (("simulation.disturbance", "input"), ("setpoint", "output")):
        try:
            plain.with_(**{key: [{"kind": kind, where: "torque"}]})
        except IcmjError as error:
            assert "kind must be" in str(error) and f"got {kind!r}" in str(error) and "\\n" not in str(error), error
        else:
            raise AssertionError(key)
"""
    + RUN_REST,
)
RULES = Shelf(
    "controller/rules",
    "band",
    '''"""A band: an event when one component of the hold error passes a threshold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from icmj.base.array import NonNegative, Positive
from icmj.controller.design import Design
from icmj.controller.trigger import EventRule, Faces


@dataclass(frozen=True)
class Band(EventRule):
    """|e_i| = width, for one state i."""

    width: float
    state: int = 0
    delta_min: float = 1e-3

    @property
    def size(self) -> float:
        return self.width

    def resized(self, size: float) -> Band:
        return replace(self, width=size)

    def faces(self, design: Design) -> Faces:
        return Faces(np.eye(design.plant.n)[[self.state]] / self.width, np.array([0, 1]))

    def facts(self) -> Mapping[str, Any]:
        return {"width": self.width, "state": self.state, "delta_min": self.delta_min}


def from_keys(
    design: Design,
    width: Positive | None = None,
    state: Annotated[int, Ge(0)] = 0,
    delta_min: NonNegative = 1e-3,
) -> Band:
    """The rule of a run file.

    Args:
        design: of the controller.
        width: half the width of the band [unit of the state].
        state: number of the state.
        delta_min: least interval [s].
    """
    assert width is not None
    return Band(width, state, delta_min)


RULE = Band
''',
    """
import icmj, numpy as np
from pathlib import Path
from icmj.log.archive import pack, unpack
from icmj.study.file_kinds import json_schema
run = icmj.load_run("simple-0.8").with_(**{
    "simulation.duration": 10.0, "controller.Q_t": None, "controller.q_t": None,
    "controller.rule": "band", "controller.width": 0.01, "controller.delta_min": 0.02})
case = icmj.prepare(run)
result = icmj.run_case(run, "linear")
events = result.simulation.events
assert len(events) > 2
np.testing.assert_allclose(np.abs(events.x_h - events.x_o)[:, 0], 0.01, rtol=1e-9)
back = unpack(*pack(result)).controller.trigger
assert (type(back).__name__, back.width, back.state, back.delta_min) == ("Band", 0.01, 0, 0.02)
keys = json_schema("run")["$defs"]["Control"]["properties"]
assert keys["width"]["description"] == "Half the width of the band [unit of the state]."
assert "band" in str(keys["rule"])
linear = result.actual
composed = icmj.compose_run(linear, result.controller, icmj.Settings(duration=1.0), name="again")
assert (composed.controller.rule, composed.controller.width) == ("band", 0.01)
""",
    """
import icmj
from icmj.errors import RunFileError
run = icmj.load_run("simple-0.8")
for changes, words in (
    ({"controller.rule": "band", "controller.Q_t": None, "controller.q_t": None}, "the band rule needs width"),
    ({"controller.rule": "band", "controller.width": 1.0}, "the band rule has no q_t"),
    ({"controller.width": 1.0}, "the quadratic rule has no width"),
    ({"controller.rule": "band", "controller.width": -1.0}, "width: must be greater than 0"),
):
    try:
        run.with_(**changes)
    except RunFileError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(changes)
""",
    """
import sys, icmj
from icmj.errors import IcmjError
from icmj.controller.rules import RULES
from icmj.study.file_kinds import json_schema
from icmj.work.shipped import RUNS
gone = sys.argv[1]
keys = {"quadratic": {"q_t": 0.01}, "box": {"threshold": 0.01}}
(other,) = RULES.names
text = RUNS.files["simple-0.8"].read_text(encoding="utf-8").partition("[controller]")[0].replace(
    "../models/pendulum.xml", "pendulum").partition("fingerprint")
text = text[0] + text[2].partition("\\n")[2]
def read(rule, size):
    return icmj.parse_run(f'{text}[controller]\\nrule = "{rule}"\\n{size} = 0.01\\n[simulation]\\nduration = 2.0')
try:
    read(gone, *keys[gone])
except IcmjError as error:
    assert "controller.rule" in str(error) or next(iter(keys[gone])) in str(error), error
    assert "\\n" not in str(error)
else:
    raise AssertionError(gone)
json_schema("run")
result = icmj.run_case(read(other, *keys[other]), "linear")
assert len(result.simulation.t) > 100
""",
)
CONTROLLERS = Shelf(
    "runfile/controllers",
    "spring",
    '''"""A spring: delayed feedback of one output to every input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from icmj.base.array import Finite
from icmj.controller.law import Law
from icmj.controller.layout import Layout
from icmj.controller.realisation import Mode, Realisation
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.control_tables import ControllerTable, Parts
from icmj.runfile.table import keys_of, make


@dataclass(frozen=True, eq=False)
class Spring(Law):
    """u = −stiffness · y.

    Attributes:
        assumed: the plant.
        delay: of the reading [s].
        output: output that is fed back.
        stiffness: gain [input per output].
    """

    assumed: LinearPlant
    delay: float
    output: str
    stiffness: Finite = 1.0

    @property
    def plant(self) -> LinearPlant:
        return self.assumed

    @property
    def kind(self) -> str:
        return "spring"

    def facts(self) -> Mapping[str, Any]:
        return {"stiffness": self.stiffness, "delay": self.delay}

    @cached_property
    def realisation(self) -> Realisation:
        n_u, n_y = self.assumed.n_u, self.assumed.n_y
        S = np.zeros((n_u, n_y))
        S[:, self.assumed.outputs.index(self.output)] = self.stiffness
        none = np.zeros((0, 0))
        mode = Mode("on", none, np.zeros((0, n_y)), np.zeros((n_u, 0)), S)
        return Realisation(Layout.of(), (mode,), none, none, none, np.zeros(1, dtype=int), taps=(self.delay,))


@keys_of(Spring, without=("assumed", "delay"))
class SpringTable(ControllerTable):
    """A spring of a run file."""

    kind: Literal["spring"]
    """Kind of controller."""

    def law(self, parts: Parts) -> Law:
        return make(Spring, self, assumed=parts.assumed, delay=parts.delay.t_d)


TABLES, LAWS = (SpringTable,), (Spring,)
''',
    """
import icmj, numpy as np
from icmj.log.archive import pack, unpack
from icmj.study.file_kinds import json_schema
controller = {"kind": "spring", "output": "angle", "stiffness": 3.0}
run = icmj.load_run("simple-0.8").with_(controller=controller, **{
    "assumed.delay": 0.1, "simulation.duration": 1.0, "simulation.timestep": None})
result = icmj.run_case(run, "linear")
t, y, u = result.simulation.t, result.simulation.y[:, 0], result.simulation.u[:, 0]
late = np.interp(t - 0.1, t, y)
np.testing.assert_allclose(u[t > 0.1], -3.0 * late[t > 0.1], atol=1e-5)
back = unpack(*pack(result))
assert (back.controller.kind, back.controller.stiffness) == ("spring", 3.0)
keys = json_schema("run")["$defs"]["SpringTable"]["properties"]
assert keys["stiffness"]["description"] == "Gain [input per output]."
""",
    """
import icmj
from icmj.errors import RunFileError
run = icmj.load_run("simple-0.8")
for controller, words in (
    ({"kind": "spring"}, "controller.output is missing"),
    ({"kind": "spring", "output": "angle", "stiffness": "much"}, "controller.stiffness: expected a number"),
    ({"kind": "springs", "output": "angle"}, "'delayed-pid', 'spring' or the module:name of a controller of your own"),
):
    try:
        run.with_(controller=controller)
    except RunFileError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(controller)
""",
    READ_REST
    + """
for kind in ["a:b" if one.startswith("own_") else one.replace("_", "-") for one in gone]:
    try:
        plain.with_(controller={"kind": kind})
    except IcmjError as error:
        assert "kind must be 'intermittent'" in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(kind)
"""
    + RUN_REST,
)
FORMATS = Shelf(
    "series/formats",
    "lines",
    '''"""Lines of JSON: an object in each, with the time "t" [s] and the signals."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from icmj.series.columns import choose_columns
from icmj.series.series import Series

SUFFIXES = (".jsonl",)


def read(path: Path, file: BinaryIO, columns: Sequence[str], rate: float | None) -> tuple[Series, ...]:
    rows = [json.loads(line) for line in file]
    names = list(rows[0]) if rows else []
    choice = choose_columns(names, [""] * len(names), columns, rate)
    return choice.to_trials(np.array([[row[names[i]] for i in choice.at] for row in rows], dtype=float))


def write(series: Series, part: Path) -> None:
    rows = zip(series.t.tolist(), series.values.tolist(), strict=True)
    part.write_text("".join(json.dumps({"t": t, **dict(zip(series.names, row))}) + "\\n" for t, row in rows))
''',
    """
import json, sys, icmj
import numpy as np
from pathlib import Path
from icmj.cli.main import main
t = np.arange(500) / 100
series = icmj.Series(t, np.column_stack([np.sin(9 * t), np.cos(5 * t)]), ("ap", "ml"))
icmj.write_series(series, "own.jsonl")
back = icmj.read_series("own.jsonl", columns=["ml"])
np.testing.assert_array_equal(back["ml"], series["ml"])
assert main(["measure", "own.jsonl", "--json"]) == 0
""",
    """
import icmj
from pathlib import Path
from icmj.errors import DataError
wrong = {"{": "cannot be read", '{"t": 0.0}\\n': "no column of numbers", '{"ap": 1.0}\\n': "no column of times"}
for text, words in wrong.items():
    Path("wrong.jsonl").write_text(text)
    try:
        icmj.read_series("wrong.jsonl")
    except DataError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(text)
""",
    """
import sys, icmj
import numpy as np
from pathlib import Path
from icmj.errors import DataError
from icmj.series.formats import FORMATS
from icmj.series.writing import find_writers
suffixes = {"csv": ".csv", "parquet": ".parquet", "npz": ".npz", "opensim": ".mot", "c3d": ".c3d"}
t = np.arange(500) / 100
series = icmj.Series(t, np.column_stack([np.sin(9 * t), np.cos(5 * t)]), ("ap", "ml"))
for suffix in find_writers():
    icmj.write_series(series, f"left{suffix}")
    np.testing.assert_array_equal(icmj.read_series(f"left{suffix}").values, series.values)
for gone in map(suffixes.get, sys.argv[1:]):
    assert gone not in find_writers()
    Path(f"gone{gone}").write_text("nothing")
    try:
        icmj.read_series(f"gone{gone}")
    except DataError as error:
        assert "\\n" not in str(error), error
    else:
        raise AssertionError(gone)
""",
)
KIND_FILE = '''"""Drift: where an output is on average."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from icmj.base.array import Array, Positive
from icmj.case.case import Case, PlantKind
from icmj.experiments.recording import Recording
from icmj.report import style
from icmj.report.experiment import Row
from icmj.runfile.schema import RunFile
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.study.kind import CaseResult, Kind, Names, Word, sample_rows, set_duration

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class FoundDrift:
    """Means of trials."""

    means: Array

    @property
    def numbers(self) -> Mapping[str, float]:
        return {"mean (rad)": float(self.means.mean())}

    @property
    def deviations(self) -> Mapping[str, float]:
        return {}

    @property
    def curves(self) -> Mapping[str, Array]:
        return {"mean (rad)": self.means}

    @property
    def words(self) -> str:
        return f"It drifts by {self.means.mean():.3g} rad."


class DriftTable(Kind):
    """Drift: the output that is averaged, and for how long."""

    meaning: ClassVar[str] = "Drift: the mean of an output."
    first_run: ClassVar[str] = "simple-0.8"

    duration: Positive = 1.0
    """Duration of a trial [s]."""
    output: Word
    """Output that is averaged."""

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        return {"output": names.outputs[0]}

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        return set_duration(run, self.duration, 100.0)

    def record(self, case: Case, simulation: Simulation) -> Series:
        return sample_rows(simulation.to_series().chosen([f"y.{self.output}"]), simulation, 100.0)

    def read(self, series: Series) -> Series:
        return series.chosen([self.output])

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundDrift:
        return FoundDrift(np.array([one.series.values.mean() for one in recordings]))

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        figure, (axes,) = style.new_figure()
        axes.plot([one.finding.numbers["mean (rad)"] for one in found if one.finding], "o")
        return figure

    def caption(self, rows: Sequence[Row]) -> str:
        return "Means of the cases."

    def methods(self, recorded: bool) -> str:
        return f"The mean is over {self.duration:g} s."


KIND = DriftTable
'''
FILE_OF = """
import contextlib, io, sys, icmj
from pathlib import Path
from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.study.file_kinds import json_schema
from icmj.study.kinds import KINDS
head = '[experiment]\\nname = "e"\\nplants = ["linear"]\\nrepetitions = 2\\n[[case]]\\nrun = "simple-0.8"\\n'
def write(table):
    Path("e.toml").write_text(head + table)
    return "e.toml"
def says(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.suppress(SystemExit):
        assert main([*words]) == 0
    return out.getvalue()
def refuses(words, call, *arguments, **options):
    try:
        call(*arguments, **options)
    except IcmjError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(words)
"""
KINDS = Shelf(
    "study/kinds",
    "drift",
    KIND_FILE,
    FILE_OF
    + f"""
import json
import numpy as np
table = 'output = "angle"\\nduration = 0.5\\n'
done = icmj.run_experiment(write("[drift]\\n" + table), "out", jobs=1)
found, trial = done["simple-0.8.linear"], icmj.read_series("out/trials/simple-0.8.linear.0001.parquet")
assert found.finding.numbers["mean (rad)"] == np.mean(trial.values) != 0
page = Path("out/report.html").read_text().replace("\\xa0", " ")
assert all(words in page for words in ("It drifts by", "Means of the cases.", "The mean is over 0.5 s."))
assert "drift" in says("new", "--help")
entry = json_schema("experiment")
assert entry["properties"]["drift"]["description"] == "Drift: the mean of an output."
assert entry["$defs"]["DriftTable"]["properties"]["output"]["description"] == "Output that is averaged."
says("new", "experiment", "--stimulus", "drift", "--out", "first.toml")
first = Path("first.toml").read_text()
assert "Its kind is drift" in first and "# Duration of a trial [s].\\n# duration = 1.0" in first
assert icmj.load_experiment("first.toml").kind == "drift"
# the same as a file of the user's own: in this process, and in others
Path("mine.py").write_text({KIND_FILE!r})
write('["mine:DriftTable"]\\n' + table)
refuses("e.toml: mine:DriftTable names Python code, which is not run unasked", icmj.load_experiment, "e.toml")
own = icmj.load_experiment("e.toml", allow_code=True)
assert own.kind == "mine:DriftTable"
for jobs in (1, 2):
    again = icmj.run_experiment(own, f"own-{{jobs}}", jobs=jobs)["simple-0.8.linear"]
    assert again.finding.numbers == found.finding.numbers and again.words == found.words
assert Path("own-2/report.html").read_text() == Path("out/report.html").read_text()
files = sorted(Path("own-1/trials").glob("*1.parquet"))
Path("e.toml").write_text(Path("e.toml").read_text().replace("angle", "y.angle"))
read = icmj.analyse_recordings(icmj.load_experiment("e.toml", allow_code=True), files)
assert read.found[0].finding.numbers["mean (rad)"] == np.mean(trial.values)
""",
    FILE_OF
    + f"""
for table, words in (
    ("[drift]\\n", "drift.output is missing"),
    ('[drift]\\noutput = "angle"\\nduration = -1.0', "drift.duration: must be greater than 0"),
    ("[drifts]\\n", "did you mean drift?"),
):
    refuses(words, icmj.load_experiment, write(table))
text = {KIND_FILE!r}
half = text[:text.index("    def draw")] + text[text.index("    def caption"):]
Path("half.py").write_text(half)
Path("bad.py").write_text(text.replace("FoundDrift(np.array(", "FoundDrift(np.no_such_thing("))
fails = "    output: Word\\n    def model_post_init(self, _): 1 / 0\\n"
Path("worse.py").write_text(text.replace("    output: Word\\n", fails))
for table, words in (
    ('["half:DriftTable"]\\noutput = "angle"', "half:DriftTable: a kind of experiment needs draw"),
    ('["bad:FoundDrift"]\\n', "bad:FoundDrift: expected a class that inherits from icmj.study.Kind"),
    ('["bad:DriftTable"]\\n', "bad:DriftTable.output is missing"),
    ('["worse:DriftTable"]\\noutput = "angle"', "worse:DriftTable fails (ZeroDivisionError"),
    ('["none:DriftTable"]\\n', "none:DriftTable: importing it fails (ModuleNotFoundError"),
):
    refuses(words, icmj.load_experiment, write(table), allow_code=True)
file = icmj.load_experiment(write('["bad:DriftTable"]\\noutput = "angle"\\nduration = 0.5'), allow_code=True)
(told,) = icmj.run_experiment(file, jobs=1).found
assert told.words.startswith("no conclusion, because bad:DriftTable fails (AttributeError:"), told.words
""",
    FILE_OF
    + """
from icmj.study.experiment_file import ExperimentFile
from icmj.work.shipped import EXPERIMENTS
gone, left = sys.argv[1:], KINDS.names
helped, schema = says("new", "--help"), str(json_schema("experiment"))
for one in gone:
    assert one not in helped and one not in schema
    refuses(f"{one}: no such key", icmj.load_experiment, write(f"[{one}]\\n"))
refused = []
for name in EXPERIMENTS.files:
    try:
        assert icmj.load_experiment(name).kind in left
    except IcmjError as error:
        assert any(one in str(error) for one in gone), error
        refused.append(name)
assert len(refused) < len(EXPERIMENTS.files)
for name in left:
    says("new", "experiment", "simple-0.8", "--stimulus", name, "--out", f"first-{name}.toml")
    assert icmj.load_experiment(f"first-{name}.toml").kind == name
    Path(f"first-{name}.toml").unlink()
trials = {
    "quiet_standing": "duration = 3.0\\nsettle = 0.0",
    "multisine": 'input = "torque"\\namplitude = 1.0\\nperiod = 1.0\\nlines = [1.0, 2.0]\\nperiods = 2',
}
for name in [name for name in trials if name in left][:1]:
    file = write(f"[{name}]\\n{trials[name]}")
    (told,) = icmj.run_experiment(file, "out-" + "-".join(left), jobs=1).found
    assert told.finding is not None, told.words
""",
)
MEASURE_FILE = '''"""How often a coordinate turns back."""

from __future__ import annotations

import numpy as np

from icmj.base.array import NonNegative
from icmj.measurement import Definition, Signal, define_measure


@define_measure(
    "turns",
    "turns of direction",
    "1/s",
    of=["coordinate"],
    standard=True,
    definitions=[Definition("turns of direction", "turns, divided by $T$", "nobody")],
)
def turns(signal: Signal, *, least: NonNegative = 0.0) -> float:
    """Changes of direction per second.

    Args:
        signal: a coordinate.
        least: distance below which a movement does not count [unit].
    """
    moved = np.diff(signal.values)
    return float(np.count_nonzero(np.diff(np.sign(moved[np.abs(moved) > least]))) / signal.duration)


MEASURE = turns
'''
SWAYING = """
import contextlib, io, json, pickle, sys, icmj
import numpy as np
from pathlib import Path
from icmj.cli.main import main
from icmj.errors import IcmjError
from icmj.measurement.measures import MEASURES, find_measure, numbers_of, tabulate_definitions
from icmj.study.file_kinds import json_schema
from icmj.work.own_code import Code
t = np.arange(3000) / 100
series = icmj.Series(t, 0.01 * np.column_stack([np.sin(np.pi * t), np.cos(np.pi * t)]), ("ap", "ml"), ("m", "m"))
icmj.write_series(series, "sway.csv")
def says(*words, status=0):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as told:
        try:
            ended = main([*words])
        except SystemExit as stop:
            ended = stop.code or 0
    assert ended == status, (words, told.getvalue())
    return " ".join((out.getvalue() or told.getvalue().strip()).split(" " if status else None))
def measured(*words):
    (first, second) = json.loads(says("measure", "sway.csv", "--json", *words))["coordinates"]
    return first
def refuses(words, *given):
    said = says("measure", "sway.csv", "--quiet", *given, status=2)
    assert words in said and "\\n" not in said, said
def experiment(name, table="", case='run = "simple-0.8"', **options):
    head = '[experiment]\\nname = "e"\\nplants = ["linear"]\\nrepetitions = 2\\n[[case]]\\n'
    Path(f"{name}.toml").write_text(f"{head}{case}\\n[quiet_standing]\\nduration = 10.0\\nsettle = 0.0\\n{table}")
    return icmj.load_experiment(f"{name}.toml", **options)
noise = 'kind = "noise", input = "torque", size = 0.05, bandwidth = 3.0, seed = 1'
noisy = f'run = "simple-0.8"\\nset.simulation.disturbance = [{{{noise}}}]'
"""
MEASURES = Shelf(
    "measurement/measures",
    "turns",
    MEASURE_FILE,
    SWAYING
    + f"""
assert measured()["turns"] == 1.0 and measured("--least", "1.0")["turns"] == 0.0
shown = says("measure", "sway.csv")
assert "turns of direction (1/s) 1 0.9667" in shown, shown
assert "--least FLOAT Distance below which a movement does not count [unit]." in says("measure", "--help")
assert "| turns of direction | turns, divided by $T$ | nobody |" in tabulate_definitions()
sway = icmj.measure_sway(series, least=1.0)
again = pickle.loads(pickle.dumps(sway)).coordinates[1]
assert again.turns == again.number("turns") == 0.0 and again.measures[-1].settings == dict(least=1.0)
done = icmj.analyse_recordings(experiment("listed"), ["sway.csv"], "out")
name = "ap, turns of direction (1/s)"
part = icmj.measure_sway(series.until(10.0), low_pass=10.0).coordinates[0]
assert done.found[0].finding.numbers[name] == part.turns > 0, (done.found[0].finding.numbers[name], part.turns)
assert "turns of direction" in Path("out/report.html").read_text().replace("\\xa0", " ")
run = icmj.prepare(icmj.load_run("simple-0.8").with_(**{{"simulation.duration": 1.0, "simulation.timestep": None}}))
many = icmj.simulate_many(run, 17, keep=("sway",), jobs=2)
assert many["sway.angle.turns"].shape == (17,)
# the same as one of the user's own: in this process, and in others
Path("mine.py").write_text({MEASURE_FILE!r}.replace("turns", "bends").replace("standard=True", "standard=False"))
assert "bends" not in measured()
assert measured("--measure", "mine:bends", "--allow-code")["bends"] == 1.0
refuses("mine:bends names Python code, which is not run unasked", "--measure", "mine:bends")
own = find_measure("mine:bends", Code(Path.cwd(), True))
found = icmj.measure_sway(series, measures=[own.with_options(least=1.0)])
again = pickle.loads(pickle.dumps(found)).coordinates[0]
assert again.bends == 0.0 and again.measures[-1].settings == dict(least=1.0)
table = 'measures = ["mine:bends"]'
file = experiment("own", table, noisy, allow_code=True)
told = [icmj.run_experiment(file, f"own-{{jobs}}", jobs=jobs).found[0].finding.numbers for jobs in (1, 2)]
name = "cop.x, {{}} of direction (1/s)".format
assert repr(told[0]) == repr(told[1])
assert told[0][name("bends")] == told[0][name("turns")] > 0, told[0]
assert "bends of direction" in Path("own-2/report.html").read_text().replace("\\xa0", " ")
done = icmj.analyse_recordings(experiment("own", table, allow_code=True), ["sway.csv"])
assert done.found[0].finding.numbers["ap, bends of direction (1/s)"] == part.turns
entry = json_schema("experiment")["$defs"]["QuietStandingTable"]["properties"]["measures"]
assert entry["description"].startswith("Measures of sway beside the standard ones")
""",
    SWAYING
    + f"""
refuses("least: -1.0; expected at least 0", "--least", "-1")
refuses("--least: expected a number, got 'much'", "--least", "much")
refuses("no measure 'turn'; did you mean turns?", "--measure", "turn")
text = {MEASURE_FILE!r}.replace("turns", "bends")
for name, old, new, words in (
    ("plain", "@define_measure(", "@(lambda *given, **more: lambda compute: compute)(", "expected a measure, which"),
    ("mute", '"bends of direction",', '"",', "its number needs a key such as 'frequency.mean', and words"),
    ("odd", '"bends",', '"b-ends",', "a measure called 'b-ends'; expected a name such as 'mean_speed'"),
    ("bare", " = 0.0)", ")", "least must be an option: after *, with a type and a default value"),
    ("blind", "signal: Signal, *,", "*,", "its function takes the signal first"),
    ("far", '["coordinate"]', '["space"]', "expected some of 'coordinate', 'plane'"),
    ("same", '"bends",', '"rms",', "two measures have the name 'rms'"),
    ("alike", '"bends of direction",', '"mean speed",', "two measures have the words 'mean speed'"),
    ("fails", "return float(", "return float(1 / 0 + ", "fails:bends fails (ZeroDivisionError"),
    ("worded", "return float(", 'return str(', "worded:bends fails (ValueError"),
    ("none", "import numpy", "import nunpy", "none:bends: importing it fails (ModuleNotFoundError"),
):
    if name == "worded":
        source = text.replace("    return float(", "    return 'x' + str(")
    else:
        assert old in text, old
        source = text.replace(old, new, 1)
    Path(f"{{name}}.py").write_text(source)
    refuses(words, "--measure", f"{{name}}:bends", "--allow-code")
for table, words in (
    ('measures = ["turn"]', "no measure 'turn'; did you mean turns?"),
    ('measures = ["mute:bends"]', "mute:bends: importing it: measure bends: its number needs a key"),
    ('measures = [1]', "measures"),
):
    try:
        experiment("wrong", table, allow_code=True)
    except IcmjError as error:
        assert words in str(error) and "\\n" not in str(error), error
    else:
        raise AssertionError(table)
file = experiment("broken", 'measures = ["fails:bends"]', allow_code=True)
try:
    icmj.analyse_recordings(file, ["sway.csv"])
except IcmjError as error:
    assert str(error).startswith("fails:bends fails (ZeroDivisionError") and "\\n" not in str(error), error
else:
    raise AssertionError(file)
""",
    SWAYING
    + """
gone = set(sys.argv[1:])
assert not gone & {*MEASURES.names} and len(MEASURES.names) == 10 - len(gone)
says("measure", "--help")
for one in gone:
    refuses(f"no measure '{one}'", "--measure", one)
sway = icmj.measure_sway(series)
assert len(sway.coordinates[0].numbers) == len(numbers_of()) > 4 and "ap" in says("measure", "sway.csv")
assert set(measured()) - {"name", "unit"} == set(sway.coordinates[0].values)
sway.card()
done = icmj.analyse_recordings(experiment("rest"), ["sway.csv"], f"out-{'-'.join(sorted(gone))}")
numbers = done.found[0].finding.numbers
assert [name for name in numbers if name.startswith("ap, ")][-1] == "ap, share of trials of several modes"
assert len(numbers) == 2 * (len(numbers_of()) + 1) and "ap has" in done.found[0].words
from icmj.fits.summaries import summarise
walk = np.cumsum(np.random.default_rng(1).standard_normal(4000)) * 1e-4
from matplotlib.figure import Figure
needed = {"root_mean_square", "mean_speed", "power_distribution", "stabilogram"}
try:
    assert np.isfinite(summarise(walk)).all() and not gone & needed
except IcmjError as error:
    assert gone & needed and "there is no measure" in str(error) and "\\n" not in str(error), error
for draw, lost in (("sway_path", None), ("sway_diffusion", "stabilogram"), ("sway_spectrum", None)):
    try:
        getattr(icmj.plots, draw)(Figure().subplots(), sway)
        assert lost not in gone
    except IcmjError as error:
        assert lost in gone and "\\n" not in str(error), error
from icmj.report.sections.noise_statistics import compose  # noqa: F401
from icmj.fits.page import write_fit  # noqa: F401
""",
)
COMMANDS = Shelf(
    "cli/commands",
    "margin",
    '''"""``icmj margin``: how far the critical interval of a case is above the least one of its rule."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.cli.arguments import POSITIONAL, Given
from icmj.cli.overrides import Overrides
from icmj.cli.progress import Working
from icmj.errors import CycleError

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class MarginCommand(Overrides):
    """Say how far the critical interval of a case is above the least one.

    Example: icmj margin simple-0.8
    """

    group = "Predict"

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    figures: Annotated[int, Given(least=1)] = 4
    """Significant figures."""
    unit: Literal["s", "ms"] = "s"
    """Unit of the answer."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        from icmj.case.case import prepare

        with Working("margin", err):
            case = prepare(self.load(self.run))
        if case.prediction is None or case.prediction.delta_crit is None:
            raise CycleError(f"{self.run}: no critical interval")
        margin = case.prediction.delta_crit - case.controller.trigger.delta_min
        out.say(f"margin {margin * (1000 if self.unit == 'ms' else 1):.{self.figures}g} {self.unit}")


COMMAND = MarginCommand
''',
    """
import contextlib, io, sys, icmj
from importlib.util import find_spec
from pathlib import Path
from icmj.cli.main import main
def says(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([*words]) == 0
    return out.getvalue()
case = icmj.prepare(icmj.load_run("simple-0.8").with_(**{"actual.gain": 0.85}))
margin = case.prediction.delta_crit - case.controller.trigger.delta_min
assert says("margin", "simple-0.8", "--set", "actual.gain=0.85", "--unit", "ms") == f"margin {1000 * margin:.4g} ms\\n"
listed = says("--help").split("Predict:")[1].split("Simulate:")[0]
assert "\\n  margin     Say how far the critical interval" in listed
shown = says("margin", "--help")
for words in ("--figures INT", "Significant figures. (default: 4)", "--unit {s,ms}", "--set KEY=VALUE", "-q, --quiet"):
    assert words in shown, shown
for shell in ("bash", "zsh"):
    assert "--figures" in says("--print-completion", shell)
if find_spec("sphinx"):
    sys.path.insert(0, "docs/_ext")
    from command_line import write_reference
    lines = write_reference()
    assert "Significant figures. (default: 4)" in " ".join(lines[lines.index("## icmj margin"):])
""",
    """
import contextlib, io
from pathlib import Path
import icmj.cli
from icmj.cli.main import main
def refuses(words, status=2):
    with contextlib.redirect_stderr(io.StringIO()) as err:
        assert main([*words.split(), "--quiet"]) == status, words
    assert err.getvalue().startswith("icmj: ") and err.getvalue().count("\\n") == 1, err.getvalue()
    return err.getvalue()
for words, said in (
    ("margin", "margin: the following arguments are required: PATH; see icmj margin --help"),
    ("margn simple-0.8", "no command 'margn'; did you mean margin?"),
    ("margin simple-0.8 --figurs 3", "margin has no option --figurs; did you mean --figures?"),
    ("margin simple-0.8 --figures many", "--figures: expected a whole number, got 'many'"),
    ("margin simple-0.8 --figures 0", "--figures 0: expected at least 1"),
    ("margin simple-0.8 --unit m", "--unit: expected ms or s, got 'm'"),
    ("margin simple-0.8 three", "margin: one argument too many, three"),
    ("margin one-link-switching", "no critical interval"),
):
    assert said in refuses(words), (words, refuses(words))
(Path(icmj.cli.__file__).parent / "commands/margin.py").write_text(
    "from icmj.cli.arguments import Command\\nclass Half(Command):\\n    group = 'Predict'\\nCOMMAND = Half\\n")
for name in [name for name in __import__("sys").modules if name.endswith("commands.margin")]:
    del __import__("sys").modules[name]
assert "carry_out" in refuses("margin", 70)
""",
    """
import contextlib, io, sys, icmj
from icmj.cli.commands import COMMANDS
from icmj.cli.main import main
gone = sys.argv[1:]
def says(*words, status=0):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        assert main([*words]) == status, (words, err.getvalue())
    return out.getvalue() + err.getvalue()
listed, _, also = says("--help").partition("\\nAlso: ")
also = also.partition("\\n")[0].split(", ")
assert len(COMMANDS.names) == 19 - len(gone)
for name in COMMANDS.names:
    assert (name in also) != (f"\\n  {name} " in listed) and f"usage: icmj {name}" in says(name, "--help")
completion = says("--print-completion", "bash")
for one in gone:
    assert f"\\n  {one} " not in listed and one not in also and f"icmj_{one}" not in completion
    assert f"no command {one!r}" in says(one, status=2)
short = ["--set", "simulation.duration=1", "--set", "simulation.timestep=0.002", "--plant", "linear"]
for words in (["cases"], ["linearise", "pendulum"], ["analyse", "simple-0.8"], ["run", "simple-0.8", *short]):
    if words[0] not in gone:
        says(*words)
""",
)
REPORTED = """
import re, sys, icmj
import numpy as np
from pathlib import Path
from icmj.report.builder import build_report
quiet = icmj.load_run("simple-0.8").with_(**{"simulation.duration": 12.0, "simulation.timestep": None,
    "study.growth_points": 2, "study.attractor_starts": 2, "study.law_q_t": []})
noisy = quiet.with_(**{"case.name": "noisy", "case.title": "Noisy", "simulation.disturbance": [
    {"kind": "gaussian", "output": "angle", "size": 3e-4, "interval": 0.01, "seed": 1}]})
results = [icmj.run_case(run, "linear", study=run is quiet) for run in (quiet, noisy)]
def build(*results, **more):
    build_report(results, Path("out/page.html"), **more)
    return Path("out/page.html").read_text(encoding="utf-8")
"""
# without what is taken away, where figures stand is looked at; drawing them is most of the time
SKETCHED = (
    REPORTED
    + """
icmj.report.style.save = lambda figure, kind: b"<svg/>"
"""
)
PANELS = Shelf(
    "report/panels",
    "distance",
    '''"""Panel (j): the size of the state against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.panel import Panel

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _draw(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    for plant, result in case.runs.items():
        run = result.simulation
        axes.semilogy(run.t, np.linalg.norm(run.x, axis=1), label=style.NAME[plant], **style.RUN[plant])
    axes.set(xlabel="$t$ (s)", ylabel="size of the state")
    style.link("time", axes)
    style.legend(figure, axes)
    return figure


PANEL = Panel("j", _draw, lambda case: "Size of the state over time.", lambda case: not case.first.simulation.noisy)
''',
    REPORTED
    + """
page = build(*results)
assert page.count("(j) Size of the state over time.") == 1 and 'panel (j)" viewBox' in page
assert {path.name for path in Path("out/page_figures").glob("*_j.*")} == {"simple-0.8_j.svg", "simple-0.8_j.pdf"}
""",
    "",
    SKETCHED.replace("study=run is quiet", "study=False")
    + """
letters = {"modulus": "a", "locus": "b", "outputs_over_time": "c", "phase_plane": "d", "open_loop_intervals": "e",
           "critical_mode": "f", "hold_error": "i"}  # the others are of actuators with limits, and of a floor
page = build(*results)
assert set(re.findall(r"<p>[(](\\w)[)] ", page)) == set("abcdefi") - {*map(letters.get, sys.argv[1:])}
icmj.plots.panels(results[0])
""",
)
SECTIONS = Shelf(
    "report/sections",
    "longest_intervals",
    '''"""The section of the longest intervals: how long each run was left alone at most."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from icmj.report import style
from icmj.report.case_runs import CaseRuns
from icmj.report.material import Material
from icmj.report.picture import Drawing
from icmj.report.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compose(material: Material) -> Section | None:
    items = [
        {"title": case.first.run.title, "longest": max(case.last.simulation.events.interval), "picture": picture}
        for case in material.cases
        for picture in map(material.show, list_drawings(case))
    ]
    return Section("longest", "Longest intervals", TEMPLATE, {"items": items}) if items else None


def list_drawings(case: CaseRuns) -> Iterator[Drawing]:
    if not case.first.simulation.noisy:
        yield Drawing(f"{case.name}_longest", "Sorted intervals", partial(_draw, case))


def _draw(case: CaseRuns) -> Figure:
    figure, (axes,) = style.new_figure()
    axes.plot(sorted(case.last.simulation.events.interval))
    return figure


TEMPLATE = """\\
{% for item in c["items"] %}
<figure>{{ item.picture|drawn }}
<figcaption>Figure {{ next_figure() }}. {{ item.title }}: at most {{ item.longest }} s.</figcaption></figure>
{% endfor %}
"""
''',
    REPORTED
    + """
page = build(*results)
longest = max(results[0].simulation.events.interval)
assert '<section id="longest">' in page and '<a href="#longest">Longest intervals</a>' in page
found = re.findall(r"Figure ([0-9]+)[.] .*: at most (.*) s[.]", page)
assert found == [("4", str(longest))], found  # after the panels of two cases, and distributions of one
assert (Path("out/page_figures") / "simple-0.8_longest.pdf").exists()
""",
    "",
    SKETCHED
    + """
anchors = {"summary_table": "summary", "paper_statements": "statements", "case_panels": "figures",
           "noise_statistics": "noise", "coexisting_attractors": "attractors", "rival_controllers": "controllers",
           "other_controllers": "others", "design_matrices": "design", "run_settings": "settings"}
for name in ("one-link-delayed-pd", "one-link-switching"):
    run = icmj.load_run(name).with_(**{"simulation.duration": 20.0})
    results.append(icmj.run_case(run, "linear"))
page = build(*results)
shown = [anchor for name, anchor in anchors.items() if name not in sys.argv[1:]]
assert re.findall('<section id="(.*)">', page) == shown, re.findall('<section id="(.*)">', page)
assert [int(n) for n in re.findall(r"<b>Figure ([0-9]+)[.]</b>", page)] == list(range(1, page.count("<b>Figure ") + 1))
""",
)
SHELVES = {
    "formats of recordings": FORMATS, "shapes": SHAPES, "event rules": RULES, "controllers": CONTROLLERS,
    "kinds of experiments": KINDS, "measures of sway": MEASURES, "commands": COMMANDS,
    "panels of the report": PANELS,
    "sections of the report": SECTIONS,
}  # fmt: skip


@contextmanager
def copied() -> Iterator[Path]:
    """A folder with a copy of the package, and of what it ships."""
    with tempfile.TemporaryDirectory(prefix="icmj-additions-") as folder:
        there = Path(folder)
        shutil.copytree(ROOT / "icmj", there / "icmj", symlinks=True, ignore=shutil.ignore_patterns("*.nb?", "*.lock"))
        for name in ("models", "runs", "sweeps", "experiments", "families", "docs"):
            (there / name).symlink_to(ROOT / name, target_is_directory=True)
        yield there


def names_of(shelf: Shelf) -> tuple[str, ...]:
    """The files of a shelf that its list names."""
    text = (ROOT / "icmj" / shelf.folder / "__init__.py").read_text(encoding="utf-8")
    return tuple(re.findall(r'^        "(\w+)",$', text, re.MULTILINE))


def execute(place: Path, program: str, *words: str) -> None:
    """Run a program with the package of a folder, interpreted; what was copied has the bytecode of the checkout.

    Raises:
        AssertionError: with what it printed, if it fails.
    """
    environment = os.environ | {"PYTHONPATH": str(place), "ICMJ_INTERPRETED": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    check = f"import icmj\nassert icmj.__file__.startswith({str(place)!r}), icmj.__file__\n"
    done = subprocess.run(
        [sys.executable, "-c", check + program, *words],
        capture_output=True, text=True, check=False, cwd=place, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"


def add(place: Path, shelf: Shelf) -> None:
    """Add a thing: one file, one line; it works, and is refused where it is malformed."""
    folder = place / "icmj" / shelf.folder
    (folder / f"{shelf.name}.py").write_text(shelf.source, encoding="utf-8")
    entries = folder / "__init__.py"
    text = entries.read_text(encoding="utf-8")
    entries.write_text(
        text.replace(last := f'        "{names_of(shelf)[-1]}",\n', f'{last}        "{shelf.name}",\n'), "utf-8"
    )
    execute(place, shelf.works + shelf.refused)


def take_away(place: Path, shelf: Shelf, names: Sequence[str]) -> None:
    """Take shipped things away, their files and lines: the rest works."""
    folder = place / "icmj" / shelf.folder
    files = [folder / "__init__.py", *(folder / f"{name}.py" for name in names)]
    sources = {file: file.read_text(encoding="utf-8") for file in files}
    left = sources[files[0]]
    for name in names:
        left = left.replace(f'        "{name}",\n', "")
        (folder / f"{name}.py").unlink()
    files[0].write_text(left, encoding="utf-8")
    try:
        execute(place, shelf.rest, *names)
    finally:
        for file, source in sources.items():
            file.write_text(source, encoding="utf-8")


def main() -> None:
    """Every shelf."""
    for title, shelf in SHELVES.items():
        with copied() as place:
            for name in names_of(shelf):
                take_away(place, shelf, [name])
                print(f"{title}: without {name}", flush=True)
            add(place, shelf)
            print(f"{title}: with {shelf.name}", flush=True)


if __name__ == "__main__":
    main()

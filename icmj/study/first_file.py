"""First files of a run file: a sweep, experiment or family file that runs as it is.

They are complete: keys that are needed, or make the example, have values, and the others stand in comments. Meanings
are the docstrings under the keys, so that a key which is new is in the next file.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, get_args

from icmj.runfile.editor_schema import docstrings
from icmj.runfile.schema import RunFile, key_text, value_text
from icmj.runfile.table import TomlTable
from icmj.study.file_kinds import schema_of
from icmj.study.kind import Kind as ExperimentKind
from icmj.study.kind import Names
from icmj.study.kinds import KINDS

Kind = Literal["sweep", "experiment", "family"]
_RUN_OF: Mapping[str, str] = {"sweep": "simple-0.8", "family": "quiet-standing"}
_PAGE = 118  # columns of comments
_MODES = ("own", "continuous")
# what a key may hold that is not set by default, by table; those of kinds of experiments say it themselves
_EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "SweepHeadTable": {"samples": 1000, "chunk": 50},
    "VaryTable": {"change": {"what": "mass", "by": "factor"}, "values": [0.8, 0.9, 1.0]},
    "CaseTable": {"interval": 0.35, "set": {"controller": {"q_t": 0.005}}},
    "FamilyTable": {"set": {"simulation": {"limit": 0.15}}},
    "PriorTable": {"median": 1.0, "deviation": 0.3},
}
_SET: Mapping[str, Any] = {"simulation.duration": 20.0}


def shipped_run(kind: Kind, stimulus: str) -> str:
    """The shipped case that a file is of where none is given."""
    return str(KINDS[stimulus].KIND.first_run) if kind == "experiment" else _RUN_OF[kind]


def draft_file(
    kind: Kind, file: str, name: str, run: str, base: RunFile, names: Names, stimulus: str = KINDS.names[0]
) -> str:
    """The text of a file that runs as it is.

    Args:
        kind: kind of file.
        file: name of the file.
        name: of the sweep, experiment or family.
        run: the run file as the new file names it.
        base: that run file.
        names: of the plant.
        stimulus: kind of an experiment.
    """
    values = {
        "sweep": _sweep_values, "experiment": _experiment_values, "family": _family_values
    }[kind](name, run, base, names, stimulus)  # fmt: skip
    model = schema_of(kind)
    said = docstrings(model) | {
        key: field.description for key, field in model.model_fields.items() if field.description
    }
    lines = [*_file_head(kind, file, names, stimulus)]
    for key, field in model.model_fields.items():
        table = table_of(field)
        if table is None:
            lines += ["", *_comment(said[key]), f"# [{key}]", *(f"# {k} = {value_text(v)}" for k, v in _SET.items())]
        elif key in values or not (field.is_required() or field.default is None):
            entries = values.get(key, {})
            several = isinstance(entries, Sequence)
            for i, entry in enumerate(entries if several else (entries,)):
                head = f"[[{key}]]" if several else f"[{key}]"
                lines += ["", *(_comment(said[key]) if i == 0 else ()), head, *_entry_lines(table, entry, i == 0)]
    return "\n".join(lines) + "\n"


def _file_head(kind: Kind, file: str, names: Names, stimulus: str) -> Iterator[str]:
    others = ", ".join(each for each in KINDS.names if each != stimulus)
    does = {
        "sweep": "icmj sweep {0} computes it, icmj sweep {0} --dry-run says how long that takes",
        "experiment": f"icmj experiment {{0}} carries it out. Its kind is {stimulus}; other kinds are {others}",
        "family": "icmj fit RECORDING --model {0} fits it",
    }
    yield from _comment(f"A first {kind} file. {does[kind].format(file)}.")
    yield "# Every key is here, those in comments with their default or an example. The plant has"
    for what in ("inputs", "outputs", "states"):
        yield from textwrap.wrap(
            ", ".join(getattr(names, what)) or "none", _PAGE, initial_indent=f"#   {what:<9}",
            subsequent_indent=f"#   {'':<9}", break_on_hyphens=False,
        )  # fmt: skip


def table_of(field: Any) -> type[TomlTable] | None:
    """The table that a key is, or that each entry of its list is."""
    waiting: list[Any] = [field.annotation]
    while waiting:
        each = waiting.pop()
        if isinstance(each, type) and issubclass(each, TomlTable):
            return each
        waiting += get_args(each)
    return None


def _entry_lines(table: type[TomlTable], values: Mapping[str, Any], explained: bool) -> Iterator[str]:
    """The keys of one table; where it is explained, all of them, each after its meaning."""
    said = docstrings(table)
    examples = table.examples if issubclass(table, ExperimentKind) else _EXAMPLES.get(table.__name__, {})
    for key, field in table.model_fields.items():
        if explained:
            yield from _comment(said[key])
            inner = table_of(field)
            for part, words in docstrings(inner).items() if inner is not None else ():
                yield from _comment(f"{part}: {words}", "#   ")
        if key in values:
            yield f"{key_text(key)} = {_toml(values[key])}"
        elif explained:
            default = field.get_default(call_default_factory=True)
            known = default is not None and default != {} and default != ""
            yield f"# {key_text(key)} = {_toml(default if known else examples.get(key, default))}"


def _comment(words: str, begin: str = "# ") -> list[str]:
    # emphasis of the reference is no emphasis in a file
    plain = re.sub(r"`{1,2}", "", words)
    return textwrap.wrap(plain, _PAGE, initial_indent=begin, subsequent_indent=begin, break_on_hyphens=False)


def _toml(value: Any) -> str:
    """A value as TOML writes it, tables on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key_text(k)} = {_toml(v)}" for k, v in value.items()) + " }" if value else "{}"
    return value_text(value)


def _sweep_values(name: str, run: str, base: RunFile, names: Names, stimulus: str) -> dict[str, Any]:
    return {
        "sweep": {"name": name, "run": run},
        "vary": [{"field": "actual.gain", "name": "b", "low": 0.7, "high": 1.2, "count": 6}],
        "ask": {"motion": ["linear"]},
    }


def _experiment_values(name: str, run: str, base: RunFile, names: Names, stimulus: str) -> dict[str, Any]:
    kind: type[ExperimentKind] = KINDS[stimulus].KIND
    shipped = run == kind.first_run
    changes = {"set": kind.first_changes} if shipped and kind.first_changes else {}
    controls = _MODES if base.has_events else _MODES[:1]
    cases = [{"run": run, "name": control, "control": control, **changes} for control in controls]
    engine = {"plants": ["linear"]}  # the quick one
    return {
        "experiment": {"name": name, **engine, "seed": 1}, stimulus: kind.first_values(names, shipped), "case": cases
    }  # fmt: skip


def _family_values(name: str, run: str, base: RunFile, names: Names, stimulus: str) -> dict[str, Any]:
    lagged = [state for state in names.states if "_act" in state]
    weights = {(lagged or names.states)[0]: 1.0}
    parameters: list[dict[str, Any]] = []
    threshold = getattr(base.controller, "q_t", None)
    if isinstance(threshold, float):
        parameters.append(_parameter_values("q_t", "threshold", "", {"controller.q_t": 1.0}, threshold))
    sizes = {
        f"simulation.disturbance[{i}].size": size
        for i, source in enumerate(base.simulation.disturbance)
        if source.unknown_size and getattr(source, "input", None) in names.inputs
        if (size := getattr(source, "size", None))
    }
    if sizes:
        first = next(iter(sizes.values()))
        keys = {key: float(f"{size / first:.4g}") for key, size in sizes.items()}
        parameters.append(_parameter_values("noise", "size of the noise", "", keys, first))
    if not parameters:
        parameters.append(
            _parameter_values("gain", "input gain b, of which the model says 1", "", {"actual.gain": 1.0}, 1.0)
        )
    return {
        "family": {"name": name, "title": f"{base.case.title}, unknown parameters", "run": run},
        "pressure": {"weight": 762.04, "torque": weights},
        "parameter": parameters,
    }


def _parameter_values(name: str, title: str, unit: str, keys: Mapping[str, float], about: float) -> dict[str, Any]:
    low, high = (float(f"{factor * about:.3g}") for factor in (0.3, 3.0))
    prior = {"kind": "log-uniform", "low": low, "high": high}
    return {"name": name, "unit": unit, "title": title, "keys": keys, "prior": prior, "source": "ours"}

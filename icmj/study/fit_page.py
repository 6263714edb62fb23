"""What a fit leaves in its folder: tables as Parquet, numbers as JSON, a file for ArviZ each, figures, and a page."""

from __future__ import annotations

import base64
import json
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base.card import plain
from icmj.base.files import whole, write_bytes, write_text
from icmj.base.numbers import amount
from icmj.base.version import VERSION
from icmj.errors import FitError
from icmj.fitting.archive import write_archive
from icmj.fitting.calibration import CAVEAT as VERDICT
from icmj.fitting.choice import CAVEAT as CHOICE
from icmj.fitting.choice import ORIGIN, TRIED
from icmj.fitting.family import DELAY, RATE
from icmj.fitting.predictive import CAVEAT as PREDICTION
from icmj.fitting.summaries import MEASURE_UNITS, MEASURES
from icmj.report import style
from icmj.report.builder import filled
from icmj.report.fit import calibration_figure, confusion_figure, groups_figure, posterior_figure, sway_figure
from icmj.report.sections import Picture, Section
from icmj.study.families import Trained
from icmj.study.fit import PREDICTED, Fit, Fitted, simulated

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS, SUMMARY, PAGE = "results.parquet", "summary.json", "report.html"
LEAD = (
    "Parameters of a controller, estimated from recordings of standing people by comparison with simulated people. The "
    "estimates assume that the family of controllers is right, and that the controller keeps the person standing. They "
    "are exploratory."
)
_SHOWN = 12  # people with pictures
_NAMED = 24  # fits whose findings come first


def write_fit(found: Fit, out: Path) -> None:
    """Write everything into the folder.

    Raises:
        FitError: if a file cannot be written.
    """
    try:
        with whole(out / RESULTS) as part:
            pq.write_table(table(found), part)
        write_text(out / SUMMARY, json.dumps(summary(found), indent=1, ensure_ascii=False) + "\n")
        for one in found.fitted:
            _archive(found, one, out / f"{one.person.stem(one.family)}.nc")
        with style.applied():
            items = _items(found, out)
        section = Section("fit", "Fit", "fit.html.j2", {"items": items})
        page = filled(
            [section],
            title=f"Fit of {_whose(found)}",
            subtitle=f"Under {', '.join(trained.family.title for trained in found.trained.values())}",
            abstract=LEAD,
            kicker="Fit",
            source="recordings and simulated people",
            beside="The figures are also available as SVG and PNG files beside this page.",
        )
        write_text(out / PAGE, page)
    except OSError as error:
        raise FitError(f"{out}: cannot be written to: {error.strerror}; choose another --out") from error


def table(found: Fit) -> pa.Table:
    """A row for each number of each person under each family."""
    rows = []
    for one in found.fitted:
        trained = found.trained[one.family]
        low, median, high = np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0)
        probability = _probability(found, one)
        for i, name in enumerate(trained.family.prior.names):
            rows.append(
                {
                    "person": one.person.name,
                    "group": one.person.group,
                    "condition": one.person.condition,
                    "family": one.family,
                    "number": name,
                    "unit": trained.family.prior.units[i],
                    "median": float(median[i]),
                    "low": float(low[i]),
                    "high": float(high[i]),
                    "z_mean": float(one.z[:, i].mean()),
                    "z_deviation": float(one.z[:, i].std()),
                    "verdict": trained.calibration.verdicts[i],
                    "support": one.support,
                    "misfit": one.misfit.words,
                    "family_probability": probability,
                }
            )
    made = pa.Table.from_pylist(rows)
    return made if found.probabilities is None else made.replace_schema_metadata({"family_probability": CHOICE})


def summary(found: Fit) -> dict[str, Any]:
    """All numbers, for programs."""
    families = {name: _family(each) for name, each in found.trained.items()}
    people = []
    for i, one in enumerate(found.people):
        fits = {each.family: _person(found, each) for each in found.fitted if each.person is one}
        chosen = None
        if found.probabilities is not None:
            chosen = dict(zip(found.trained, map(float, found.probabilities[i]), strict=True))
        facts = {"person": one.name, "group": one.group, "condition": one.condition, "trials": len(one.trials)}
        people.append({**facts, "held_out": one.held, "probabilities": chosen, "fits": fits})
    choice = None
    if found.confusion is not None:
        c = found.confusion
        choice = {
            "families": list(c.families),
            "counts": c.counts.tolist(),
            "accuracy": c.accuracy,
            "confidence": c.confidence,
            "error": c.error,
            "not_told_apart": [list(pair) for pair in c.alike],
            "words": c.words,
            "caveat": f"{CHOICE}. {ORIGIN}",
        }
    groups = {
        name: [{key: getattr(one, key) for key in ("name", "groups", "people", "paired", "value", "low", "high", "p")}
               | {"holm": one.holm, "verdict": one.verdict, "words": one.words} for one in each]
        for name, each in found.differences.items()
    }  # fmt: skip
    made = {"icmj": VERSION, "families": families, "people": people, "choice": choice, "differences": groups}
    return dict(plain(made))


def _family(trained: Trained) -> dict[str, Any]:
    c, prior = trained.calibration, trained.family.prior
    numbers = {
        name: {
            "unit": prior.units[i],
            "verdict": c.verdicts[i],
            "contraction": float(c.contraction[i]),
            "coverage": float(c.coverage[i]),
            "coverage_low": float(c.coverage_low[i]),
            "coverage_high": float(c.coverage_high[i]),
            "p": float(c.p_values[i]),
        }
        for i, name in enumerate(c.names)
    }
    return {"title": trained.family.title, "bank": trained.words, "people": len(c.ranks), "numbers": numbers}


def _person(found: Fit, one: Fitted) -> dict[str, Any]:
    prior, p = found.trained[one.family].family.prior, one.predictive
    low, median, high = np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0)
    numbers = {
        name: {"median": float(median[i]), "low": float(low[i]), "high": float(high[i])}
        for i, name in enumerate(prior.names)
    }
    sway = {
        name: {
            "unit": MEASURE_UNITS[i], "low": float(p.low[i]), "high": float(p.high[i]),
            "recorded": p.observed[:, i].tolist(), "inside": p.inside[:, i].tolist(),
        }
        for i, name in enumerate(MEASURES)
    }  # fmt: skip
    facts = {"misfit": one.misfit.words, "support": one.support, "draws": len(one.z), "fell": p.fell}
    return {**facts, "numbers": numbers, "predicted": sway}


def _probability(found: Fit, one: Fitted) -> float:
    if found.probabilities is None:
        return 1.0
    return float(found.probabilities[found.people.index(one.person), list(found.trained).index(one.family)])


def _archive(found: Fit, one: Fitted, path: Path) -> None:
    prior = found.trained[one.family].family.prior
    facts = {"family": one.family, "person": one.person.name, "misfit": one.misfit.words, "icmj": VERSION}
    facts |= {"group": one.person.group, "condition": one.person.condition}
    write_archive(
        path, prior.names, prior.units, one.theta, prior.draw(len(one.theta), 1), MEASURES,
        one.predictive.simulated, one.predictive.observed, {**facts, "support": one.support},
    )  # fmt: skip


def _items(found: Fit, out: Path) -> list[dict[str, Any]]:
    """The parts of the page, whose figures are written beside it."""
    items = [
        _item("Findings", [_finding(found, one) for one in found.fitted[:_NAMED]], [], []),
        _item("How far this carries", [f"{PREDICTION}.", f"{VERDICT}.", f"{ORIGIN}."], [], []),
    ]
    if found.confusion is not None and found.probabilities is not None:
        c = found.confusion
        rows = [
            (one.label, *(f"{p:.2f}" for p in each))
            for one, each in zip(found.people, found.probabilities, strict=True)
        ]
        words = [
            f"{CHOICE}.",
            f"{c.words}. Their mean confidence is {c.confidence:.2f}, their accuracy {c.accuracy:.2f}.",
        ]
        picture = _picture(confusion_figure(c.families, c.counts), out, "families")
        caption = "Synthetic people: the family that they were simulated with and the one they are assigned to."
        tables = [(("Probability", *c.families), rows), TRIED]
        items.append(_item("Which family", words, tables, [(picture, caption)]))
    for name, differences in found.differences.items():
        if differences:
            labels = [f"{one.name}: {one.groups[1]} − {one.groups[0]}" for one in differences]
            value, low, high = (
                np.array([getattr(one, key) for one in differences]) for key in ("value", "low", "high")
            )
            figure = groups_figure(labels, value, low, high, [one.verdict for one in differences])
            caption = "Differences between groups, with 95 % intervals; a difference that cannot be estimated has none."
            words = [one.words + "." for one in differences]
            title = f"Groups, under {found.trained[name].family.title}"
            items.append(_item(title, words, [], [(_picture(figure, out, f"groups.{name}"), caption)]))
    items += [
        _person_item(found, one, out, drawn=i < _SHOWN * len(found.trained)) for i, one in enumerate(found.fitted)
    ]
    return items + [_family_item(each, out) for each in found.trained.values()]


def _whose(found: Fit) -> str:
    names = list(dict.fromkeys(one.name for one in found.people))
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} people"


def _finding(found: Fit, one: Fitted) -> str:
    """What was inferred of one person under one family, with its uncertainty."""
    trained = found.trained[one.family]
    prior, low_median_high = trained.family.prior, np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0)
    told = [
        f"{name} is {amount(median, prior.units[i], 3)} ({amount(low, '', 3)} to {amount(high, '', 3)})"
        for i, (name, low, median, high) in enumerate(zip(prior.names, *low_median_high.tolist(), strict=True))
        if trained.calibration.verdicts[i] == "identified"
    ]
    inferred = "; ".join(told) if told else "these recordings identify no parameter"
    chosen = "" if found.probabilities is None else f", whose probability is {_probability(found, one):.2f}"
    warning = " Do not trust this fit (see below)." if one.misfit else ""
    return f"{one.person.label}, under {trained.family.title}{chosen}: {inferred}.{warning}"


def _family_item(trained: Trained, out: Path) -> dict[str, Any]:
    c, prior = trained.calibration, trained.family.prior
    rows = [
        (
            f"{name} ({prior.units[i]})" if prior.units[i] else name, c.verdicts[i], f"{c.contraction[i]:.2f}",
            f"{c.coverage[i]:.0%} ({c.coverage_low[i]:.0%} to {c.coverage_high[i]:.0%})", f"{c.p_values[i]:.2g}",
        )
        for i, name in enumerate(c.names)
    ]  # fmt: skip
    head = ("Parameter", "Verdict", "Contraction", "Coverage of 90 %", "p")
    words = [
        trained.words,
        f"Calibrated on {len(c.ranks)} synthetic people that it was not trained on. Contraction: relative reduction of "
        "the variance from the prior to the posterior. Coverage: share of 90 % intervals that contain the true value, "
        "with its 95 % interval. p: p-value of the hypothesis that the posteriors are calibrated.",
        *([f"{DELAY[0].upper()}{DELAY[1:]}."] if trained.family.has_delay else []),
    ]
    picture = _picture(calibration_figure(c.names, c.ranks, c.verdicts), out, f"calibration.{trained.family.name}")
    caption = "Distribution of the ranks of the true parameters minus the uniform one, with the 95 % band at each rank."
    return _item(f"Reliability: {trained.family.title}", words, [(head, rows)], [(picture, caption)])


def _person_item(found: Fit, one: Fitted, out: Path, drawn: bool) -> dict[str, Any]:
    trained, p = found.trained[one.family], one.predictive
    prior, verdicts = trained.family.prior, trained.calibration.verdicts
    low, median, high = np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0)
    rows = [
        (
            f"{name} ({prior.units[i]})" if prior.units[i] else name,
            *(amount(of[i], figures=4) for of in (median, low, high)),
            verdicts[i],
        )
        for i, name in enumerate(prior.names)
    ]
    words = [words_of(one)]
    pictures = []
    if drawn:
        sample = prior.draw(4000, 1)
        figure = posterior_figure(prior.names, prior.units, one.theta, sample, verdicts)
        pictures.append(
            (_picture(figure, out, f"posterior.{one.person.stem(one.family)}"), "Posterior (blue) and prior (grey).")
        )
        made = [simulated(trained.family, theta, i) for i, theta in enumerate(one.theta[:6])]
        shown = [cop for cop in made if cop is not None][: len(one.person.trials)]
        figure = sway_figure(one.person.trials, shown, RATE, MEASURES, MEASURE_UNITS, p.simulated, p.observed)
        caption = (
            "Recorded and simulated trials; measures of the recordings (dots), and the 90 % predictive intervals, "
            "which covered only 69 to 84 % of the values of people whom the families had not seen."
        )
        pictures.append((_picture(figure, out, f"sway.{one.person.stem(one.family)}"), caption))
    head = ("Parameter", "Median", "5 %", "95 %", "Verdict")
    return _item(f"{one.person.label}: {trained.family.title}", words, [(head, rows)], pictures)


def words_of(one: Fitted) -> str:
    """One sentence on one person under one family, the misfit first."""
    p = one.predictive
    held = "held-out" if one.person.held else "fitted"
    inside = f"{p.inside.sum()} of {p.inside.size} measures of {held} trials lie in their 90 % predictive intervals"
    rests = (
        f"the posterior rests on an effective number of {one.support:.0f} of the people simulated to train it; {inside}"
    )
    fell = f"; {p.fell:.0%} of {PREDICTED} simulated draws fell" if p.fell > 0 else ""
    misfit = f"{one.misfit.words[0].upper()}{one.misfit.words[1:]}. " if one.misfit else ""
    return f"{misfit}{rests[0].upper()}{rests[1:]}{fell}."


def caveats(found: Fit) -> list[str]:
    """What must be known beside the probabilities, predictions and verdicts of a fit, as sentences."""
    said = [VERDICT, PREDICTION]
    if found.probabilities is not None:
        made = [f"under {of} with {how} to {what}" for of, how, what in TRIED[1]]
        said.insert(0, f"{CHOICE.replace(' (table)', '')}; synthetic people were assigned, {'; '.join(made)}")
    return [f"{one}." for one in (*said, ORIGIN)]


def _item(title: str, words: list[str], tables: list[Any], pictures: list[Any]) -> dict[str, Any]:
    return {"title": title, "words": words, "tables": tables, "pictures": pictures}


def _picture(figure: Figure, out: Path, name: str) -> Picture:
    svg, png = style.save(figure, "svg"), BytesIO()
    figure.savefig(png, format="png", dpi=160, metadata={"Software": None})
    write_bytes(out / f"{name}.svg", svg)
    write_bytes(out / f"{name}.png", png.getvalue())
    return Picture(name, f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}", name)

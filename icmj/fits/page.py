"""What a fit leaves in its folder: tables as Parquet, numbers as JSON, a file for ArviZ each, figures, and a page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from icmj.base import VERSION
from icmj.base.array import Array
from icmj.base.files import whole, write_bytes, write_text
from icmj.base.numbers import MISSING, plain, readable
from icmj.base.numbers import count as many
from icmj.base.numbers import number as number_of
from icmj.case.quantity import in_unit
from icmj.errors import FitError
from icmj.experiments.quiet_standing import YOUNG_PEOPLE
from icmj.fits.arviz_file import write_archive
from icmj.fits.choice import AT_ONCE, ORIGIN, TRIED, say_probability
from icmj.fits.choice import CAVEAT as CHOICE
from icmj.fits.family import DELAY, RATE, Prior
from icmj.fits.fit import PREDICTED, FamilyFit, Fit, Subject, TrainedFamily, simulate_member
from icmj.fits.groups import Difference
from icmj.fits.posterior import CALIBRATION_CAVEAT as VERDICT
from icmj.fits.posterior import PREDICTION_CAVEAT as PREDICTION
from icmj.fits.summaries import MEASURE_UNITS, MEASURES, measures, summarise
from icmj.measurement.measures import numbers_of
from icmj.report import style
from icmj.report.findings import (
    calibration_figure,
    confusion_figure,
    groups_figure,
    math_name,
    posterior_figure,
    sway_figure,
)
from icmj.report.notation import symbol
from icmj.report.page import render_page
from icmj.report.picture import Picture
from icmj.report.section import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS, SUMMARY, PAGE = "results.parquet", "summary.json", "report.html"
METHODS = (
    "Each family of controllers is simulated with parameters drawn from its prior, and a network learns the posterior "
    "distribution of the parameters, given measures of the centre of pressure from front to back (icmj measure). "
    "Estimates are medians, and intervals in brackets are 90 % credible intervals. They assume that the family is "
    "right, and that the controller keeps the person standing. A parameter is identified if its posterior is, for "
    "synthetic people, at most half as wide in variance as its prior, and its intervals contain the true value as "
    "often as they should. Results are exploratory."
)
_SHOWN = 12  # people with pictures
_NAMED = 6  # fits of which each has a finding of its own


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
        with style.apply():
            parts = _sections(found, out)
        titles = [trained.family.title for trained in found.trained.values()]
        page = render_page(
            parts,
            title=f"Fit of {_whose(found)}",
            subtitle=f"Recorded data: {_amount(found)}. Assumed: {', '.join(map(_lower, titles))}",
            findings=_findings(found),
            kicker="Fit",
            source="recordings and simulated people",
            beside="The figures are also available as SVG and PNG files beside this page.",
        )
        write_text(out / PAGE, page)
    except OSError as error:
        raise FitError(f"{out}: cannot be written to ({error.strerror}); choose another --out") from error


def table(found: Fit) -> pa.Table:
    """A row for each number of each person under each family."""
    rows = []
    for one in found.fitted:
        person, units = one.person, found.trained[one.family].family.prior.units
        whose = {"person": person.name, "group": person.group, "condition": person.condition, "family": one.family}
        told = {"support": one.support, "misfit": one.misfit.words, "family_probability": _probability(found, one)}
        for unit, (name, each) in zip(units, _estimates(found, one).items(), strict=True):
            rows.append({**whose, "number": name, "unit": unit, **each, **told})
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
        name: [{key: value for key, value in vars(one).items() if key != "means"} for one in each]
        for name, each in found.differences.items()
    }
    made = {"icmj": VERSION, "families": families, "people": people, "choice": choice, "differences": groups}
    return dict(plain(made))


def _family(trained: TrainedFamily) -> dict[str, Any]:
    c, prior = trained.calibration, trained.family.prior
    columns = {
        "unit": prior.units, "verdict": c.verdicts, "contraction": c.contraction, "coverage": c.coverage,
        "coverage_low": c.coverage_low, "coverage_high": c.coverage_high, "p": c.p_values,
    }  # fmt: skip
    numbers = _by_name(c.names, columns)
    return {"title": trained.family.title, "bank": trained.words, "people": len(c.ranks), "numbers": numbers}


def _estimates(found: Fit, one: FamilyFit) -> dict[str, dict[str, Any]]:
    """Each number of a person: median, interval, mean and deviation as z, contraction and verdict."""
    trained, z = found.trained[one.family], one.z.T
    low, median, high = np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0).tolist()
    columns = {
        "median": median, "low": low, "high": high,
        "z_mean": [float(of.mean()) for of in z], "z_deviation": [float(of.std()) for of in z],
        "contraction": one.contraction.tolist(), "verdict": trained.calibration.judge(one.contraction),
    }  # fmt: skip
    return _by_name(trained.family.prior.names, columns)


def _by_name(names: Sequence[str], columns: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What columns have of each name."""
    rows = zip(*columns.values(), strict=True)
    return {name: dict(zip(columns, row, strict=True)) for name, row in zip(names, rows, strict=True)}


def _person(found: Fit, one: FamilyFit) -> dict[str, Any]:
    p, shown = one.predictive, ("median", "low", "high", "contraction", "verdict")
    numbers = {name: {key: each[key] for key in shown} for name, each in _estimates(found, one).items()}
    columns = {"unit": MEASURE_UNITS, "low": p.low, "high": p.high, "recorded": p.observed.T, "inside": p.inside.T}
    facts = {"misfit": one.misfit.words, "support": one.support, "draws": len(one.z), "fell": p.fell}
    return {**facts, "numbers": numbers, "predicted": _by_name(MEASURES, columns)}


def _probability(found: Fit, one: FamilyFit) -> float:
    if found.probabilities is None:
        return 1.0
    return float(found.probabilities[found.people.index(one.person), list(found.trained).index(one.family)])


def _archive(found: Fit, one: FamilyFit, path: Path) -> None:
    prior = found.trained[one.family].family.prior
    facts = {"family": one.family, "person": one.person.name, "misfit": one.misfit.words, "icmj": VERSION}
    facts |= {"group": one.person.group, "condition": one.person.condition}
    write_archive(
        path, prior.names, prior.units, one.theta, prior.draw(len(one.theta), 1), MEASURES,
        one.predictive.simulated, one.predictive.observed, {**facts, "support": one.support},
    )  # fmt: skip


def _sections(found: Fit, out: Path) -> list[Section]:
    """The parts of the page, whose figures are written beside it."""
    reliable = [f"{one}." for one in (PREDICTION, VERDICT, ORIGIN)]
    parts = [("sway", "Sway, and what was inferred", [_overview(found)])]
    if found.confusion is not None:
        parts.append(("family", "Which family", [_choice_item(found, out)]))
    groups = [_groups_item(found, name, each, out) for name, each in found.differences.items() if each]
    if groups:
        parts.append(("groups", "Groups", groups))
    drawn = _SHOWN * len(found.trained)
    people = [_person_item(found, one, out, i < drawn) for i, one in enumerate(found.fitted)]
    parts.append(("people", "Each person" if len(found.people) > 1 else "Posterior and prediction", people))
    families = [_family_item(each, out) for each in found.trained.values()]
    parts.append(("reliability", "How reliable this is", [_item("", reliable, [], []), *families]))
    words = [METHODS, *(trained.words for trained in found.trained.values())]
    parts.append(("methods", "Methods", [_item("", words, [], [])]))
    return [Section(anchor, title, _TEMPLATE, {"items": items}) for anchor, title, items in parts]


def _choice_item(found: Fit, out: Path) -> dict[str, Any]:
    c, probabilities = found.confusion, found.probabilities
    assert c is not None
    assert probabilities is not None
    rows = [(one.label, *map(say_probability, each)) for one, each in zip(found.people, probabilities, strict=True)]
    words = [f"{CHOICE}.", f"{c.words}. Their mean confidence is {c.confidence:.2f}, their accuracy {c.accuracy:.2f}."]
    picture = _picture(confusion_figure(c.families, c.counts), out, "families")
    caption = "Synthetic people: the family that they were simulated with, and the one to which they are assigned."
    titles = ("Probability of each family", "Synthetic people whose noise no family assumes")
    tables = [(titles[0], ("", *c.families), rows), (titles[1], *TRIED)]
    return _item("", words, tables, [(*picture, caption)])


def _groups_item(found: Fit, name: str, differences: Sequence[Difference], out: Path) -> dict[str, Any]:
    tested = [one for one in differences if np.isfinite(one.p)]
    known = {one.name.partition(", ")[0] for one in tested}
    names = dict.fromkeys(one.name.partition(", ")[0] for one in differences)
    rest = [symbol(each) for each in names if each not in known]
    why = "not identified, or constrained by recordings of fewer than three people of a group"
    words = [f"There is no conclusion on {', '.join(rest)} ({why})."] if rest else []
    if not tested:
        return _item(found.trained[name].family.title, words, [], [])
    rows = []
    for one in tested:
        difference = f"{one.value:+.2f} ({one.low:+.2f} to {one.high:+.2f})".replace("-", "−")
        of = f"{one.groups[1]} − {one.groups[0]}", f"{one.people[1]}, {one.people[0]}"
        rows.append((_symbols(one.name), *of, difference, number_of(one.holm, 2), one.verdict))
    head = ("", "Difference", "People", "Standard deviations of the prior", "p", "Verdict")
    title = "Differences between groups and between conditions, with 95 % intervals; p is corrected by Holm’s method."
    labels = [f"{', '.join(map(math_name, one.name.split(', ')))}: {one.groups[1]} − {one.groups[0]}" for one in tested]
    value, low, high = (np.array([getattr(one, key) for one in tested]) for key in ("value", "low", "high"))
    figure = groups_figure(labels, value, low, high, [one.verdict for one in tested])
    caption = "The differences of the table, with 95 % intervals; orange: those that are significant."
    shown = [(*_picture(figure, out, f"groups.{name}"), caption)]
    return _item(found.trained[name].family.title, words, [(title, head, rows)], shown)


def _symbols(name: str) -> str:
    """The name of a parameter, with a condition after a comma, in symbols."""
    return ", ".join(map(symbol, name.split(", ")))


def _whose(found: Fit) -> str:
    names = list(dict.fromkeys(one.name for one in found.people))
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} people"


def _amount(found: Fit) -> str:
    """How many recordings of how many people, and what was left out of the fit."""
    people = len({one.name for one in found.people})
    trials, held = sum(len(one.trials) for one in found.people), sum(one.held for one in found.people)
    of = f" of {many(people, 'person').replace('persons', 'people')}"
    conditions = {one.condition for one in found.people if one.condition}
    where = f" in {many(len(conditions), 'condition')}" if len(conditions) > 1 else ""
    return f"{many(trials, 'trial')}{of}{where}{f', {held} of them not fitted but predicted' if held else ''}"


def _findings(found: Fit) -> list[tuple[str, str]]:
    """What was inferred, with its uncertainty: of each person where there are few, of groups else."""
    if len(found.fitted) <= _NAMED:
        return [(one.person.label, _finding(found, one)) for one in found.fitted]
    words = []
    if found.probabilities is not None:
        most = np.argmax(found.probabilities, axis=1)
        shares = [f"{int((most == i).sum())} to {name}" for i, name in enumerate(found.trained)]
        caveat = CHOICE.replace(" (table)", "")
        words.append(("Family", f"{len(found.people)} cases are assigned, {' and '.join(shares)}. {caveat}."))
    for name, trained in found.trained.items():
        pairs = zip(trained.family.prior.names, trained.calibration.verdicts, strict=True)
        identified = [symbol(each) for each, verdict in pairs if verdict == "identified"]
        said = f"Identified: {', '.join(identified)}." if identified else "No parameter is identified."
        tested = [one for one in found.differences.get(name, ()) if np.isfinite(one.p)]
        differs = [one.words for one in tested if one.verdict == "differs"]
        if differs:
            said += f" {'; '.join(differs)}."
        elif tested:
            said += f" No difference is found between groups or conditions ({many(len(tested), 'comparison')})."
        words.append((trained.family.title, said))
    bad = [one for one in found.fitted if one.misfit]
    if bad:
        words.append(("Misfit", f"Do not trust {len(bad)} of {len(found.fitted)} fits, which are named below."))
    return words


def _finding(found: Fit, one: FamilyFit) -> str:
    """What was inferred of one person under one family, with its uncertainty."""
    trained = found.trained[one.family]
    prior, verdicts = trained.family.prior, trained.calibration.judge(one.contraction)
    known = [i for i, verdict in enumerate(verdicts) if verdict == "identified"]
    estimates = [f"{symbol(prior.names[i])} = {_estimate(one, prior, i)}, {prior.titles[i]}" for i in known]
    inferred = f"these recordings identify {len(known) or 'none'} of {len(prior)} parameters"
    inferred += f" ({'; '.join(estimates)})" if known else ""
    chosen = ""
    if found.probabilities is not None:
        chosen = f", whose probability is {say_probability(_probability(found, one))} ({AT_ONCE})"
    warning = " Do not trust this fit, as stated below." if one.misfit else ""
    return f"Under {_lower(trained.family.title)}{chosen}, {inferred}.{warning}"


def _estimate(one: FamilyFit, prior: Prior, i: int, named: bool = True) -> str:
    """Median and 90 % credible interval, in the unit in which people read it."""
    factor, unit = readable(prior.units[i])
    low, median, high = factor * np.quantile(one.theta[:, i], (0.05, 0.5, 0.95))
    mark = f"{'' if unit == '°' else ' '}{unit}".rstrip() if named else ""
    return f"{number_of(median, 3)}{mark} ({number_of(low, 3)} to {number_of(high, 3)})"


def _label(prior: Prior, i: int) -> str:
    _, unit = readable(prior.units[i])
    name = symbol(prior.names[i])
    title = prior.titles[i] if prior.titles[i] == name else f"{name}: {prior.titles[i]}"
    return f"{title} ({unit})" if unit else title


_WORDS = {number.key: number.words for number in numbers_of()}
_MEASURED = dict(zip(MEASURES, ("rms", "speed", "frequency.slope", "short.H", "long.H", "frequency.mean"), strict=True))


def _overview(found: Fit) -> dict[str, Any]:
    """Measures of sway by group and condition, and beneath them the identified parameters of each family."""
    cells: dict[tuple[str, str], list[Subject]] = {}
    for one in found.people:
        cells.setdefault((one.group, one.condition), []).append(one)
    heads = [", ".join(filter(None, key)) or _whose(found) for key in cells]
    alone = all(len(people) == 1 for people in cells.values())
    rows: list[tuple[str, ...]] = [
        ("people", *(str(len(people)) for people in cells.values()), "8"),
        ("trials", *(str(sum(len(one.trials) for one in people)) for people in cells.values()), "24"),
    ]
    swayed = {one.label: measures(np.array([summarise(trial, RATE) for trial in one.trials])) for one in found.people}
    for i, name in enumerate(MEASURES):
        key = _MEASURED[name]
        factor, unit = readable(MEASURE_UNITS[i])
        values = [
            swayed[people[0].label][:, i] if alone else np.array([swayed[one.label][:, i].mean() for one in people])
            for people in cells.values()
        ]
        young = tuple(factor * each for each in YOUNG_PEOPLE[key])
        own = (_spread(factor * each) for each in values)
        rows.append((in_unit(_WORDS.get(key, key), unit), *own, f"{number_of(young[0], 3)} ± {number_of(young[1], 2)}"))
    for name, trained in found.trained.items():
        prior = trained.family.prior
        for i in (i for i, verdict in enumerate(trained.calibration.verdicts) if verdict == "identified"):
            fits = {one.person.label: one for one in found.fitted if one.family == name}
            factor, _ = readable(prior.units[i])
            row = []
            for people in cells.values():
                medians = np.array([factor * np.median(fits[one.label].theta[:, i]) for one in people])
                row.append(_estimate(fits[people[0].label], prior, i, named=False) if alone else _spread(medians))
            rows.append((f"{_label(prior, i)}, under {name}", *row, MISSING))
    inferred = "median and 90 % credible interval" if alone else "mean ± standard deviation over people of the medians"
    words = [
        "Measures of the centre of pressure from front to back are mean ± standard deviation over "
        f"{'trials' if alone else 'people'}. Beneath them are the identified parameters ({inferred}). The values of "
        "young people are those of 24 trials of eight people on firm ground with open eyes (Santos and Duarte 2016, "
        "doi 10.7717/peerj.2648)."
    ]
    return _item("", words, [("Sway and inferred parameters", ("", *heads, "young people"), rows)], [])


def _spread(values: Array) -> str:
    mean = number_of(float(values.mean()), 3)
    return f"{mean} ± {number_of(float(values.std(ddof=1)), 2)}" if len(values) > 1 else mean


def _family_item(trained: TrainedFamily, out: Path) -> dict[str, Any]:
    c, prior = trained.calibration, trained.family.prior
    rows = [
        (
            _label(prior, i), c.verdicts[i], number_of(float(c.contraction[i]), 2),
            f"{c.coverage[i]:.0%} ({c.coverage_low[i]:.0%} to {c.coverage_high[i]:.0%})".replace("%", " %"),
            number_of(float(c.p_values[i]), 2),
        )
        for i in range(len(c.names))
    ]  # fmt: skip
    head = ("", "Verdict", "Contraction", "Coverage of 90 %", "p")
    words = [
        f"Calibrated on {len(c.ranks)} synthetic people on whom it was not trained. Contraction: relative reduction of "
        "the variance from the prior to the posterior. Coverage: share of 90 % intervals that contain the true value, "
        "with its 95 % interval. p: p-value of the hypothesis that the posteriors are calibrated.",
        *([f"{DELAY[0].upper()}{DELAY[1:]}."] if trained.family.has_delay else []),
    ]
    names = [math_name(name) for name in c.names]
    picture = _picture(calibration_figure(names, c.ranks, c.verdicts), out, f"calibration.{trained.family.name}")
    caption = "Distribution of the ranks of the true parameters minus the uniform one, with the 95 % band at each rank."
    title = trained.family.title
    return _item(title, words, [("Calibration", head, rows)], [(*picture, caption)])


def _person_item(found: Fit, one: FamilyFit, out: Path, drawn: bool) -> dict[str, Any]:
    trained, p = found.trained[one.family], one.predictive
    prior, verdicts = trained.family.prior, trained.calibration.verdicts
    factors, units = zip(*(readable(unit) for unit in prior.units), strict=True)
    quantiles = np.quantile(one.theta, (0.05, 0.5, 0.95), axis=0) * factors
    rows = [
        (_label(prior, i), *(number_of(float(quantiles[k, i]), 3) for k in (1, 0, 2)), verdicts[i])
        for i in range(len(prior))
    ]
    pictures = []
    if drawn:
        sample, stem = prior.draw(4000, 1), one.person.stem(one.family)
        names = [math_name(name) for name in prior.names]
        figure = posterior_figure(names, units, one.theta * factors, sample * factors, verdicts)
        caption = "Posterior (blue) and prior (grey) of each parameter; its verdict stands above it."
        pictures.append((*_picture(figure, out, f"posterior.{stem}"), caption))
        runs = [simulate_member(trained.family, theta, i) for i, theta in enumerate(one.theta[:6])]
        shown = [cop for cop in runs if cop is not None][: len(one.person.trials)]
        scale, of = zip(*(readable(unit) for unit in MEASURE_UNITS), strict=True)
        labels = [in_unit(_WORDS.get(_MEASURED[name], name), unit) for name, unit in zip(MEASURES, of, strict=True)]
        figure = sway_figure(one.person.trials, shown, RATE, labels, p.simulated * scale, p.observed * scale)
        caption = (
            "Above: recorded and simulated trials, and their power spectra. Beneath: measures of recorded trials "
            "(dots; orange where outside), and median and 90 % interval of simulated ones, which covered only 69 to "
            "84 % of the values of people who had no part in setting up the families."
        )
        pictures.append((*_picture(figure, out, f"sway.{stem}"), caption))
    head = ("", "Median", "5 %", "95 %", "Verdict")
    title = f"{one.person.label}: {trained.family.title}"
    return _item(title, [words_of(one)], [("Posterior", head, rows)], pictures)


def words_of(one: FamilyFit) -> str:
    """One sentence on one person under one family, the misfit first."""
    p = one.predictive
    held = "held-out" if one.person.held else "fitted"
    inside = f"{p.inside.sum()} of {p.inside.size} measures of {held} trials lie in their 90 % predictive intervals"
    rests = (
        f"the posterior rests on an effective number of {one.support:.0f} of the people simulated to train it; {inside}"
    )
    fell = f"; {100 * p.fell:.0f} % of {PREDICTED} simulated draws did not stand" if p.fell > 0 else ""
    misfit = f"{one.misfit.words[0].upper()}{one.misfit.words[1:]}. " if one.misfit else ""
    return f"{misfit}{rests[0].upper()}{rests[1:]}{fell}."


def caveats(found: Fit) -> list[str]:
    """What must be known beside the probabilities, predictions and verdicts of a fit, as sentences."""
    said = [VERDICT, PREDICTION]
    if found.probabilities is not None:
        made = [f"under {of} with {how} to {what}" for of, how, what in TRIED[1]]
        said.insert(0, f"{CHOICE.replace(' (table)', '')}; synthetic people were assigned, {'; '.join(made)}")
    return [f"{one}." for one in (*said, ORIGIN)]


def _lower(title: str) -> str:
    return title[:1].lower() + title[1:]


def _item(title: str, words: list[str], tables: list[Any], pictures: list[Any]) -> dict[str, Any]:
    return {"title": title, "words": words, "tables": tables, "pictures": pictures}


def _picture(figure: Figure, out: Path, name: str) -> tuple[Picture, str]:
    """The figure, which is written beside the page, and its largest width there; letters of all figures are alike."""
    svg, png = style.save(figure, "svg"), BytesIO()
    figure.savefig(png, format="png", dpi=160, metadata={"Software": None})
    write_bytes(out / f"{name}.svg", svg)
    write_bytes(out / f"{name}.png", png.getvalue())
    return Picture(name, svg, name), f"{6.9 * figure.get_size_inches()[0]:.1f}rem"


_TEMPLATE = """\
{% for item in c['items'] %}
{% if item.title %}<h3>{{ item.title }}</h3>{% endif %}
{% for said in item.words %}
<p>{{ said|notation }}</p>
{% endfor %}
{% for title, head, rows in item.tables %}
<div class="wide"><table class="stack">
<caption><b>Table {{ next_table() }}.</b> {{ title }}</caption>
<thead><tr>{% for name in head %}<th scope="col">{{ name }}</th>{% endfor %}</tr></thead>
<tbody>
{% for row in rows %}
<tr>{% for value in row %}{% if loop.first %}<th scope="row">{{ value|notation }}</th>{% else %}<td data-label="{{ head[loop.index0] }}">{{ value }}</td>{% endif %}{% endfor %}</tr>
{% endfor %}
</tbody>
</table></div>
{% endfor %}
{% for picture, wide, caption in item.pictures %}
<figure class="law">
<div class="panel" style="max-width: {{ wide }}">{{ picture|drawn }}</div>
<figcaption><b>Figure {{ next_figure() }}.</b> {{ caption }}</figcaption>
</figure>
{% endfor %}
{% endfor %}
"""  # noqa: E501

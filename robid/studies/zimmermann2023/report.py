"""What the study of configurations found: tables beside the paper's, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.study import Conclusion
from robid.studies.tasks import Results
from robid.studies.zimmermann2023.curves import (
    design_sections,
    effort_section,
    model_cost_section,
    response_section,
    spring_section,
    step_section,
)
from robid.studies.zimmermann2023.figures import MISSED, Found, Rivals, explained_springs, gather, rivals, summarise

_ENOUGH_COST = 1.06
_ENOUGH_EXCESS = 0.5
_FURTHER = 2.0
"""Scatter over the stated deviation above which intervals do not hold what they should."""


def conclude(run: Run, results: tuple[Results, ...]) -> Conclusion:
    """Turns the tasks' results into figures, tables and what follows for the choice of configurations."""
    found, paper = gather(run, results), paper_figures(run.loaded)
    summary = summarise(found)
    sections = (
        _data_section(found, paper),
        _model_section(found, summary, paper),
        model_cost_section(found),
        response_section(found),
        spring_section(found),
        *_explanation_sections(found, summary),
        effort_section(found.effort),
        *step_section(found, summary),
        *design_sections(run),
    )
    text, reached = _verdict(found, summary)
    return Conclusion(Verdict(text, "ok" if reached else "warn"), summary, sections)


def _verdict(found: Found, summary: Mapping[str, float]) -> tuple[str, bool]:
    """What was found in a few sentences, and whether all that is asked of it is reached."""
    study, optimal = found.study, found.study.optimal
    held, typical = rivals(found, "average"), rivals(found, "typical")
    keys = {"deviation": ("average deviation", "average_fit_std"), "scatter": ("scatter about the truth", "scatter")}
    sentences = []
    for key, each in held.items():
        what, figure = keys[key]
        figures = {name: summary.get(f"{name}.{figure}", float("nan")) for name in found.models}
        sentences.append(_standing(optimal, what, figures, each) + _otherwise(typical[key]))
    lower = any(each.lower for each in (*held.values(), *typical.values()))
    ratio = summary[f"{optimal}.over_{study.reference}_cost"]
    beside = f"{_below(ratio, _ENOUGH_COST)}; paper: 1.093"
    reached = not lower and ratio <= _ENOUGH_COST
    sentences += [f"its validation cost is {significant(ratio)} of that of {study.reference} ({beside})"]
    excess = summary.get(f"{study.nonlinear}.excess_ratio")
    if excess is not None:
        reached = reached and excess <= _ENOUGH_EXCESS
        size = _below(excess, _ENOUGH_EXCESS)
        sentences.append(f"the model with stiffening gears leaves {significant(excess)} of its excess cost ({size})")
    return f"{'; '.join(sentences)}. {found.effort.sentence}", reached


def _standing(optimal: str, what: str, figures: Mapping[str, float], held: Rivals) -> str:
    """Says whether the optimal model has the lowest figure of those with as few configurations."""
    own = figures[optimal]
    below = [f"{name} ({_deviation(figures[name])})" for name in held.tied if figures[name] < own]
    above = [name for name in held.tied if not figures[name] < own]
    if held.lower:
        lower = ", ".join(held.lower)
        first = f"{optimal} does not have the lowest {what} ({_deviation(own)}); surely below it: {lower}"
    elif below:
        first = f"no model with as few configurations has surely a lower {what} than {optimal} ({_deviation(own)})"
    else:
        first = f"{optimal} has the lowest {what} of the models with as few configurations ({_deviation(own)})"
    tied = [f"{side} it {', '.join(names)}" for names, side in ((below, "below"), (above, "above")) if names]
    return f"{first}; within what chance makes over the individuals, {' and '.join(tied)}" if tied else first


def _otherwise(typical: Rivals) -> str:
    """Names the models that are lower by the other mean."""
    lower = ", ".join(typical.lower)
    return f"; by geometric means over the springs, surely below it: {lower}" if lower else ""


def _deviation(fraction: float | None) -> str:
    """In percent with three digits: models are told apart by the third."""
    return MISSING if fraction is None else f"{significant(100 * fraction)} %"


def _below(value: float, limit: float) -> str:
    return f"asked: at most {limit:g}, {'reached' if value <= limit else 'missed'}"


def _data_section(found: Found, paper: Mapping[str, Any]) -> Section:
    comments = paper.get("comment", {})
    rows = tuple(
        (name, str(len(one.used)), ", ".join(str(index + 1) for index in one.used), comments.get(name, ""))
        for name, one in found.models.items()
    )
    heads = ("Model", "Configurations", "Their numbers", "In the paper")
    count = found.truth.shape[0]
    lead = f"Each model is fitted once for each of {count} individuals of the type; figures are medians over them."
    return Section("Table I: the data of the models", lead, (Table(heads, rows, prose=True),))


def _model_section(found: Found, summary: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    rows = []
    for name in found.models:

        def ours(key: str, name: str = name) -> float:
            return summary[f"{name}.{key}"]

        rows.append(
            (
                name,
                significant(ours("worst_cost")),
                significant(paper.get("worst_cost", {}).get(name)),
                significant(ours("average_cost")),
                significant(paper.get("average_cost", {}).get(name)),
                significant(ours("average_excess")),
                _deviation(ours("average_std")),
                _deviation(ours("average_effective_std")),
                _deviation(ours("average_fit_std")),
                _scatter(summary, name),
                _deviation(summary.get(f"{name}.offset")),
                _deviation(summary.get(f"{name}.fit_scatter")),
                _their_std(paper, name),
                f"{ours('missed'):.0f} of {summary['resonances']:.0f}",
            )
        )
    heads = (
        *("Model", "Worst cost", "Paper", "Average", "Paper", "Excess"),
        *("Noise floor", "Effective", "Deviation", "Scatter", "Offset", "Of fits", "Paper", "Missed"),
    )
    axes = " and ".join(found.study.axes)
    caption = (
        "Costs: mean squared logarithmic amplitude error per element of the validation's responses (half the payload,"
        " new phases), a motor's own response at weight 1; the paper's are of another scale. Excess: above what the"
        " validation's noise alone gives. Noise floor: relative deviation by eq. 5 with the total covariance, as in the"
        " paper, mean over the free springs. Deviation: what the fit states of the springs themselves, its interval"
        " over the normal quantile; effective: of what infinitely many configurations would give, which a design"
        " sees. Scatter: standard deviation of log(estimate / truth) over the individuals, and over disjoint sets of"
        " configurations where a model's are drawn, with its standard error; the estimate is the middle of the interval"
        " of the spring itself. Of fits: that of the fitted springs, which predict. Offset: size of that logarithm's"
        " mean, what all individuals share, such as the stiffening that a linear model takes for stiffness. Missed:"
        f" first resonances of the own responses of {axes} that are off by more than {percent(MISSED)}."
    )
    optimal = list(found.models).index(found.study.optimal)
    table = Table(heads, tuple(rows), caption=caption, strong=optimal)
    judged = "Models are judged by their scatter: the truth is known here."
    lead = " ".join((judged, *_contradictions(found, paper), *_too_sure(found, summary)))
    return Section("Table II: costs and deviations", lead, (table, _typical_table(found, summary)))


def _too_sure(found: Found, summary: Mapping[str, float]) -> tuple[str, ...]:
    """Says which models scatter much further than they state."""
    pairs = {name: (summary.get(f"{name}.scatter", 0.0), summary[f"{name}.average_fit_std"]) for name in found.models}
    return tuple(
        f"{name} states too little: it scatters by {_deviation(scattered)}, {significant(scattered / stated, 2)} times"
        f" its {_deviation(stated)}. What no doubt names takes others along."
        for name, (scattered, stated) in pairs.items()
        if scattered > _FURTHER * stated
    )


def _typical_table(found: Found, summary: Mapping[str, float]) -> Table:
    """The same deviations and scatter by geometric means."""
    keys = ("typical_effective_std", "typical_fit_std", "typical_scatter", "typical_fit_scatter")
    rows = tuple((name, *(_deviation(summary.get(f"{name}.{key}")) for key in keys)) for name in found.models)
    caption = (
        "The same by geometric means over the springs: one that no data can tell, such as a gear with a bearing in"
        " series that the robot file lacks, outweighs all others in a plain mean."
    )
    heads = ("Model", "Effective", "Deviation", "Scatter", "Of fits")
    return Table(heads, rows, caption=caption, strong=list(found.models).index(found.study.optimal))


def _scatter(summary: Mapping[str, float], name: str) -> str:
    value, error = summary.get(f"{name}.scatter"), summary.get(f"{name}.scatter_error")
    if value is None:
        return MISSING
    return _deviation(value) if error is None else f"{_deviation(value)} ± {_deviation(value * error)}"


def _contradictions(found: Found, paper: Mapping[str, Any]) -> tuple[str, ...]:
    """Says where the paper's own deviations cannot be what eq. 5 gives: information adds over configurations."""
    reference = found.models[found.study.reference]
    theirs = {**paper.get("average_std", {}), **paper.get("average_std_above", {})}
    whole = theirs.get(reference.name)
    parts = [
        name
        for name, one in found.models.items()
        if set(one.used) < set(reference.used) and whole is not None and theirs.get(name, whole) < whole
    ]
    if not parts:
        return ()
    ours = all((found.models[name].std >= reference.std).all() for name in parts)
    held = "; here it does so for every spring" if ours else ""
    return (
        f"The paper's deviations cannot be those of its eq. 5 alone: information adds over configurations, so"
        f" {reference.name}, which holds those of {', '.join(parts)}, must have smaller ones{held}. Yet the paper"
        f" prints {_their_std(paper, reference.name)} of it and"
        f" {', '.join(f'{_their_std(paper, name)} of {name}' for name in parts)}. What grows with the number of"
        " configurations is what a model lacks: a deviation that saturates in each, as the one that the fit states,"
        " is the honest one to compare.",
    )


def _their_std(paper: Mapping[str, Any], name: str) -> str:
    above = paper.get("average_std_above", {}).get(name)
    return percent(paper.get("average_std", {}).get(name)) if above is None else f"> {percent(above)}"


def _explanation_sections(found: Found, summary: Mapping[str, float]) -> tuple[Section, ...]:
    """Springs of the linear models against the slopes that the nonlinear model has where they were measured."""
    explained = explained_springs(found)
    if not explained:
        return ()
    gears = tuple(dict.fromkeys(spring for _, spring in explained))
    rows = []
    for name in dict.fromkeys(name for name, _ in explained):
        pairs = [explained[name, gear] for gear in gears]
        rows.append((name, *(percent(float(np.median(own / slope)) - 1, signed=True) for own, slope in pairs)))
    off = percent(summary.get(f"{found.study.nonlinear}.explains_error"))
    lead = (
        "A linear model finds the slope that a gear has where it was measured. Its springs against the mean slopes of"
        f" the model with stiffening gears, {found.study.nonlinear}, in the same configurations, though that was fitted"
        f" to those of {found.study.optimal} alone. Median distance: {off}."
    )
    return (Section("Local models are slopes of the nonlinear one", lead, (Table(("Model", *gears), tuple(rows)),)),)

"""What the study of parameter estimators found: tables and figures beside the paper's, and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from robid.arrays import BoolArray, ComplexArray, IntArray
from robid.pipeline.graph import Run
from robid.report.numbers import duration, percent, significant
from robid.report.page import Verdict
from robid.report.section import Beside, Figure, Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.page import Conclusion, by_name, figure, table
from robid.studies.settings.study import WernholtStudy
from robid.studies.study import Earlier, study_of
from robid.studies.wernholt2008.figures import COST_LIMIT, NEAR_BEST, Found, Models, claims, gather, spread, summarise
from robid.studies.wernholt2008.study import ALL, Individuals, gather_individuals, robot_and_delay, sizes_of

_PARAMETER_RANGE = (0.01, 100.0)
_COST_RANGE = (0.95, 20.0)
_ABOUT = {"": "by the strategy of this study", "plain": "by plain descents"}


def start_cost_section(found: Found, group: str) -> Section:
    """Figs 3 and 4: sorted costs of every estimator."""
    members, figures = found.groups[group], []
    for number, title, key in ((3, "user", "user_cost"), (4, "optimal", "optimal_cost")):
        costs = {name: np.minimum(getattr(one, key)[one.order], _COST_RANGE[1]) for name, one in members.items()}
        axes = "Start, by the cost with user weights", "Cost over the best"
        name = f"Fig. {number}: cost with {title} weights"
        figures.append(figure(name, axes, None, costs, log_x=False, y_range=_COST_RANGE))
    lead = (
        f"Models from the same starts {_ABOUT[group]}, all judged by the same two costs, each estimator's sorted by the"
        f" first. Costs above {_COST_RANGE[1]:g} are drawn there."
    )
    return Section(f"Costs {_ABOUT[group]}", lead, (Beside(tuple(figures), 2),))


def parameter_sections(found: Found, transmission: BoolArray) -> tuple[Section, ...]:
    """Figs 5 to 7: springs of gearboxes and of the arm structure for all estimators, dampers for LLS and LLSM."""
    spring = found.of_kind("stiffness")
    members = found.as_in_paper
    logarithmic = {name: one for name, one in members.items() if name.startswith("lls") and one.configuration == ALL}
    lead = (
        f"Divided by the best {found.reference} model's; plain descents where the study has them, sorted as in Fig. 3."
        " Values beyond the axis are drawn at its end."
    )
    panels = (
        ("Fig. 5: springs of the gearboxes", members, spring & transmission),
        ("Fig. 6: springs of the arm structure", members, spring & ~transmission),
        ("Fig. 7: dampers of the gearboxes", logarithmic, ~spring & transmission),
        ("Fig. 7: dampers of the arm structure", logarithmic, ~spring & ~transmission),
    )

    def drawn(models: Models, mask: BoolArray) -> Figure:
        relative = np.clip(np.exp(models.internal[models.order] - found.best), *_PARAMETER_RANGE)
        names = found.problem.parameters.names
        series = {names[index].rpartition(".")[0]: relative[:, index] for index in np.flatnonzero(mask)}
        return figure(models.name, ("", ""), None, series, log_x=False, y_range=_PARAMETER_RANGE, height=240)

    return tuple(
        Section(title, lead, (Beside(tuple(drawn(one, mask) for one in shown.values()), 3),))
        for title, shown, mask in panels
        if mask.any()
    )


def response_sections(found: Found, element: tuple[int, int]) -> tuple[Section, ...]:
    """Figs 8 and 9: the best model's response, the spread of the good ones, and the measurement."""
    alone = [one.configuration for one in found.near.values() if one.configuration != ALL]
    configuration = alone[0] if alone else 0
    best = found.problem.model_response(found.best)[configuration]
    return (_spread_section(found, configuration, element, best), _matrix_section(found, configuration, best))


def _spread_section(found: Found, configuration: int, element: tuple[int, int], best: ComplexArray) -> Section:
    output, motor = (number - 1 for number in element)
    models = found.as_in_paper[found.reference]
    near = models.internal[models.user_cost <= NEAR_BEST]
    series = {"best": np.abs(best[:, output, motor])}
    if len(near):
        kept = np.unique(np.round(near, 3), axis=0)
        size = np.array([np.abs(found.problem.model_response(one)[configuration, :, output, motor]) for one in kept])
        series |= {"smallest": size.min(axis=0), "largest": size.max(axis=0)}
    axes = "Frequency [Hz]", "Magnitude [rad/(s² N m)]"
    shown = figure(f"Element ({element[0]}, {element[1]})", axes, found.problem.frf.frequency_hz, series)
    lead = (
        f"Configuration {configuration + 1}: the best {found.reference} model and the range of its {len(near)} models"
        f" with a cost within {NEAR_BEST:g} of the best (paper: 31)."
    )
    return Section("Fig. 8: responses of the good models", lead, (shown,))


def _matrix_section(found: Found, configuration: int, best: ComplexArray) -> Section:
    frf = found.problem.frf
    response, std = np.abs(frf.response[configuration]), np.sqrt(frf.element_variance()[configuration])
    figures = []
    for output, motor in np.ndindex(response.shape[1:]):
        own = (slice(None), output, motor)
        series = {
            "measured": response[own],
            "best model": np.abs(best)[own],
            "minus one deviation": np.maximum(response[own] - std[own], 1e-2 * response[own]),
            "plus one deviation": response[own] + std[own],
        }
        title = f"{frf.output_names[output]} by {frf.input_names[motor]}"
        figures.append(figure(title, ("", ""), frf.frequency_hz, series, height=150, legend=False))
    lead = (
        f"Configuration {configuration + 1}: measured response (solid), best {found.reference} model (dashed) and one"
        f" standard deviation to each side (dots); [rad/(s² N m)] over [Hz]."
    )
    return Section("Fig. 9: measured and modelled response", lead, (Beside(tuple(figures), response.shape[2]),))


_STATISTICS = ("min", "median", "max", "mean", "std")
_REPRESENTATIVE = 4


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns the tasks' results into figures, tables and what follows for the paper's conclusions."""
    study, paper = study_of(run.loaded, WernholtStudy), paper_figures(run.loaded)
    found = gather(run, list(results[0]))
    individuals = gather_individuals(study, list(results[1]))
    summary = summarise(found) | individual_figures(individuals)
    robot, _ = robot_and_delay(run.loaded)
    transmission = {spring.name for spring in robot.springs if spring.place == "transmission"}
    of_gears = np.array([name.rpartition(".")[0] in transmission for name in found.problem.parameters.names])
    held = claims(found, study.estimators, of_gears, individuals)
    borne_out = sum(claim.reproduced is True for claim in held)
    summary |= {f"conclusion_{index}": float(claim.reproduced is True) for index, claim in enumerate(held, 1)}
    summary |= {f"conclusion_{index}.refuted": float(claim.refuted is True) for index, claim in enumerate(held, 1)}
    own = summary[f"{study.reference}.reasonable"]
    theirs = paper.get("reasonable", {}).get(study.reference)
    beside = "" if theirs is None else f" (paper: {percent(theirs)})"
    verdict = (
        f"{percent(own)} of the starts of {study.reference} end in a reasonable model{beside};"
        f" {borne_out} of the paper's {len(held)} conclusions hold here."
    )
    return Conclusion(
        verdict=Verdict(verdict, "ok"),
        summary=summary,
        sections=(
            _success_section(found, summary, paper),
            Section("The paper's seven conclusions", _OF_CLAIMS, (table(_CLAIMS, held, prose=True),)),
            *_individual_sections(individuals),
            *(start_cost_section(found, group) for group in ("", "plain") if group in found.groups),
            *parameter_sections(found, of_gears),
            _statistics_section(found, paper),
            *response_sections(found, study.element),
        ),
    )


def _success_section(found: Found, summary: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    tables = [_success_table(found, summary, paper, group) for group in found.groups]
    models = [(name, group, one) for group, members in found.groups.items() for name, one in members.items()]

    def optimal(head: str, which: str) -> tuple[str, Callable[[Any], str]]:
        key = f"{which}_optimal_cost"
        return head, lambda row: significant(summary[f"{row[0]}.{key}{row[1] and '_' + row[1]}"])

    columns = (
        ("Estimator", lambda row: f"{row[0]} {row[1]}".strip()),
        (f"Within {COST_LIMIT:g} of the best", lambda row: percent(float((row[2].optimal_cost <= COST_LIMIT).mean()))),
        *(optimal("Best cost", "best"), optimal("Median cost", "median")),
    )
    title = "The same models by the cost with optimal weights"
    caption = f"The best cost is {significant(1 / found.truth_optimal_cost)} of that of the truth."
    tables.append(table(columns, models, title=title, caption=caption))
    near = sum(len(one.own_cost) for one in found.near.values())
    lead = (
        f"A model is reasonable when its logarithmic cost with user weights is within {COST_LIMIT:g} of the best of all"
        f" models and it meets all {found.resonances} resonances of the motors' own responses within 2 %"
        f" (peaks that the true robot's linearisation does not have do not count: {found.uncounted})."
        f" The best cost is {significant(1 / found.truth_cost)} of the truth's. The {near} fits from common starts"
        f" took {duration(summary[f'fits{near}_s'])} on two cores, {summary['evaluations.median']:.0f} evaluations of"
        f" the cost each (median; at most {summary['evaluations.max']:.0f});"
        f" {percent(summary['cap_share'])} ended at the iteration limit."
    )
    return Section("Reasonable models", lead, tuple(tables))


def _success_table(found: Found, summary: Mapping[str, float], paper: Mapping[str, Any], group: str) -> Table:
    suffix, printed = group and f"_{group}", paper if group in _GROUP_TITLES else {}

    def theirs(key: str) -> tuple[str, Callable[[str], str]]:
        return "Paper", lambda name: percent(printed.get(key, {}).get(name))

    columns = (
        ("Estimator", lambda name: name),
        by_name(summary, "Reasonable", f"reasonable{suffix}", percent),
        theirs("reasonable"),
        by_name(summary, "Springs but one", f"springs_within_2{suffix}", percent),
        theirs("springs_within_2"),
        by_name(summary, "All springs", f"springs_within_2_all{suffix}", percent),
        theirs("springs_within_2_all"),
        by_name(summary, "At its own best", f"own_best{suffix}", percent),
        by_name(summary, "Best cost", f"best_cost{suffix}"),
        by_name(summary, "Median cost", f"median_cost{suffix}"),
        by_name(summary, "Evaluations", f"evaluations.median{suffix}", "{:.0f}".format),
        by_name(summary, "Most", f"evaluations.max{suffix}", "{:.0f}".format),
        by_name(summary, "Time per fit", f"seconds{suffix}", duration),
    )
    excluded = found.problem.parameters.names[found.least_determined]
    caption = (
        f"Shares of starts. Springs: within [0.5, 2] of the best {found.reference} model; all but the least"
        f" determined, {excluded}, as in the paper. At its own best: within 0.1 % of the best cost that the"
        " estimator itself reached. Costs: with user weights, over the best."
    )
    wide = f"Starts over {group.removesuffix('dec').replace('_', '.')} decades"
    return table(columns, found.groups[group], title=_GROUP_TITLES.get(group, wide), caption=caption)


_GROUP_TITLES = {"": "The strategy of this study", "plain": "Plain descents from the same starts, as in the paper"}


_CLAIMS = (
    ("The paper concludes", lambda claim: claim.text),
    ("Reproduced", lambda claim: claim.word),
    ("Here", lambda claim: claim.figures),
)
_OF_CLAIMS = (
    "Shares are those of plain descents where the study has them. A share counts as larger by more than two"
    " standard errors; a kind of parameter as easier when predicted deviation and true error are both smaller."
    " Where several individuals are measured, the third to the fifth conclusion are compared with their true values:"
    " yes where the 95 % interval of the ratio of errors over the individuals lies below 1, refuted where it lies"
    " above 0.9, so that a gain of a tenth or more is excluded; else undecided."
)


def _individual_sections(individuals: Individuals | None) -> tuple[Section, ...]:
    if individuals is None:
        return ()
    figures = individual_figures(individuals)
    columns = (
        ("Estimator", lambda name: name),
        by_name(figures, "Error", "individual_error", percent),
        by_name(figures, "With nuisance parameters", "individual_physical_error", percent),
        by_name(figures, "Stated deviation", "individual_std", percent),
        by_name(figures, "Held", "individual_covered", percent),
        by_name(figures, "Cost", "individual_misfit"),
    )
    lead = (
        "Springs and dampers of several individuals, fitted from all configurations, against their true values: size of"
        " the error, size of that of the middle of the fit's interval, where what the robot file may have wrong is"
        " estimated along, and deviation that this interval states: medians over parameters and individuals; and the"
        " share of these intervals of 95 % that hold the truth. Cost: over what noise and the assumed model error give."
    )
    return (Section("Several individuals", lead, (table(columns, individuals.error),)),)


def individual_figures(individuals: Individuals | None) -> dict[str, float]:
    """Figures over the individuals by name."""
    if individuals is None:
        return {}
    found: dict[str, float] = {}
    for name in individuals.error:
        figures = {
            "error": np.median(sizes_of(individuals.error[name])),
            "physical_error": np.median(sizes_of(individuals.physical[name])),
            "std": np.nanmedian(individuals.std[name]),
            "misfit": np.median(individuals.misfit[name]),
            "covered": individuals.inside[name].mean(),
        }
        found |= {f"{name}.individual_{key}": float(value) for key, value in figures.items()}
    return found


def representative(found: Found, kind: str) -> IntArray:
    """Indices of a few parameters of a kind, spread from the best to the least determined."""
    indices = np.flatnonzero(found.of_kind(kind))
    ordered = indices[np.argsort(found.std[indices], kind="stable")]
    places = np.linspace(0, ordered.size - 1, min(_REPRESENTATIVE, ordered.size)).round().astype(int)
    return np.asarray(ordered[places])


def _statistics_section(found: Found, paper: Mapping[str, Any]) -> Section:
    names, heads = found.problem.parameters.names, ("Parameter", *_STATISTICS, "std_th", "truth")
    chosen, truth = [*representative(found, "stiffness"), *representative(found, "damping")], found.truth - found.best
    tables = []
    for group in (group for group in ("", "plain") if group in found.groups):
        models, rows = found.groups[group][found.reference], []
        near = models.internal[models.user_cost <= NEAR_BEST]
        if len(near):
            statistics = spread(np.exp(near), np.exp(found.best))
            for index in chosen:
                own = (*(statistics[key][index] for key in _STATISTICS), found.std[index], np.exp(truth)[index])
                rows.append((names[index], *(significant(float(value)) for value in own)))
        count = f"{len(near)} models" if len(near) else "no model is near the best"
        tables.append(Table(heads, tuple(rows), title=f"{_GROUP_TITLES[group]}: {count}"))
    if theirs := paper.get("table_1", {}):
        printed = tuple((name, *map(significant, values)) for name, values in theirs.items())
        tables.append(Table(heads[:-1], printed, title="The paper's Table 1"))
    lead = (
        f"Parameters of the {found.reference} models with a cost within {NEAR_BEST:g} of the best, divided by the best"
        " model's: four springs and four dampers from the best to the least determined. The last two columns are the"
        " deviation that theory predicts for the best model, and the truth."
    )
    return Section("Table 1", lead, tuple(tables))

"""What the study of configurations found: tables and figures beside the paper's, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.design.configurations.information import ConfigurationDesign
from robid.pipeline.graph import Run
from robid.report.design import design_section
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Beside, Figure, Section
from robid.robot.kinematics import skeleton
from robid.studies.experiments import paper_figures
from robid.studies.page import Conclusion, by_name, figure, table
from robid.studies.study import Results
from robid.studies.zimmermann2023.figures import MISSED, Found, Rivals, explained_springs, gather, rivals, summarise
from robid.studies.zimmermann2023.models import chosen_designs
from robid.studies.zimmermann2023.steps import StepResponses

_ENOUGH_COST = 1.06
_ENOUGH_EXCESS = 0.5
_ERRORS = 2.0  # Standard errors that a prediction may cost more than those of random sets
_MOST_SCATTER = 1.3
_FURTHER = 2.0  # Scatter over the stated deviation above which intervals do not hold what they should


def conclude(run: Run, results: tuple[Results, ...]) -> Conclusion:
    """Turns the tasks' results into figures, tables and what follows for the choice of configurations."""
    found, paper = gather(run, results), paper_figures(run.loaded)
    summary, told = summarise(found), found.effort
    effort = deviation_figures(told.experiments, told.average, told.worst)
    used = {name: one.used for name, one in found.models.items()}
    columns = (
        ("Model", lambda name: name),
        ("Configurations", lambda name: str(len(used[name]))),
        ("Their numbers", lambda name: ", ".join(str(index + 1) for index in used[name])),
        ("In the paper", lambda name: paper.get("comment", {}).get(name, "")),
    )
    count = found.truth.shape[0]
    lead = f"Each model is fitted once for each of {count} individuals of the type; figures are medians over them."

    # Fig. 3: sorted costs of every model, averaged over the individuals.
    names, costs = list(found.models), list[Figure]()
    for part in (part for part in (names[:_MOST], names[_MOST:]) if part):
        shown = part if found.study.reference in part else [found.study.reference, *part]
        series = {name: np.sort(found.models[name].cost, axis=1).mean(axis=0) for name in shown}
        costs.append(figure("", ("Configuration, by its cost", "Cost"), None, series, log_x=False))

    def arms(name: str, design: ConfigurationDesign) -> FloatArray:
        campaign = run.loaded.experiment.campaigns[run.loaded.experiment.designs[name].campaign]
        return skeleton(run.loaded.robot.to_robot(campaign.payload_kg), design.configurations)

    sections = (
        Section("Table I: the data of the models", lead, (table(columns, used, prose=True),)),
        _model_section(found, summary, paper),
        Section("Fig. 3: costs of the validation", _OF_COSTS, (Beside(tuple(costs), 2),)),
        *(_response_section(found), _spring_section(found)),
        *_explanation_sections(found),
        Section("How long must I measure?", f"{found.effort.sentence} {_EFFORT}", (Beside(effort, 2),)),
        *_step_section(found, summary),
        # The designs that the configurations come from: arms in space, weights, information, gap.
        *(design_section(name, design, arms(name, design)) for name, design in chosen_designs(run).items()),
    )
    text, reached = _verdict(found, summary)
    return Conclusion(Verdict(text, "ok" if reached else "warn"), summary, sections)


def _verdict(found: Found, summary: Mapping[str, float]) -> tuple[str, bool]:
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
    told, predicts = _predicted(found, summary)
    return f"{'; '.join([*sentences, *told])}. {found.effort.sentence}", reached and predicts


def _predicted(found: Found, summary: Mapping[str, float]) -> tuple[list[str], bool]:
    """What the choice for prediction is worth beside random sets and the optimal one, and whether it is enough."""
    name, optimal = found.study.predictive, found.study.optimal
    ratio = summary.get(f"{name}.vs_random")
    if ratio is None:
        return [], True
    most = 1 + _ERRORS * summary[f"{name}.vs_random_error"]
    beside = summary[f"{name}.vs_{optimal}"]
    sentences = [
        f"chosen for prediction, {name} costs {significant(ratio)} of the mean of random sets ({_below(ratio, most)}),"
        f" {significant(beside)} of {optimal} ({_below(beside, 1.0)})"
    ]
    scatter = summary.get(f"{name}.scatter_vs_{optimal}")
    if scatter is not None:
        random = summary[f"{name}.random_scatter_vs_own"] * scatter
        told = f"its springs scatter {significant(scatter)} times those of {optimal} ({_below(scatter, _MOST_SCATTER)})"
        sentences.append(f"{told}, those of random sets {significant(random)} times")
    return sentences, ratio <= most and beside <= 1 and (scatter is None or scatter <= _MOST_SCATTER)


def _standing(optimal: str, what: str, figures: Mapping[str, float], held: Rivals) -> str:
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
    lower = ", ".join(typical.lower)
    return f"; by geometric means over the springs, surely below it: {lower}" if lower else ""


def _deviation(fraction: float | None) -> str:
    """In percent with three digits: models are told apart by the third."""
    return MISSING if fraction is None else f"{significant(100 * fraction)} %"


def _below(value: float, limit: float) -> str:
    return f"asked: at most {limit:.3g}, {'reached' if value <= limit else 'missed'}"


_MODEL_CAPTION = (
    "Costs: mean squared logarithmic amplitude error per element of the validation's responses (half the payload,"
    " new phases), a motor's own response at weight 1; the paper's are of another scale. Excess: above what the"
    " validation's noise alone gives. Noise floor: relative deviation by eq. 5 with the total covariance, as in the"
    " paper, mean over the free springs. Deviation: what the fit states of the springs themselves, its interval"
    " over the normal quantile; effective: of what infinitely many configurations would give, which a design"
    " sees. Scatter: standard deviation of log(estimate / truth) over the individuals, and over disjoint sets of"
    " configurations where a model's are drawn, with its standard error; the estimate is the middle of the interval"
    " of the spring itself. Of fits: that of the fitted springs, which predict. Offset: size of that logarithm's"
    " mean, what all individuals share, such as the stiffening that a linear model takes for stiffness. Missed:"
    f" first resonances of the own responses of {{axes}} that are off by more than {percent(MISSED)}."
)


def _model_section(found: Found, summary: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    def theirs(key: str, name: str) -> str:
        return significant(paper.get(key, {}).get(name))

    columns = (
        ("Model", lambda name: name),
        by_name(summary, "Worst cost", "worst_cost"),
        ("Paper", partial(theirs, "worst_cost")),
        by_name(summary, "Average", "average_cost"),
        ("Paper", partial(theirs, "average_cost")),
        by_name(summary, "Excess", "average_excess"),
        by_name(summary, "Noise floor", "average_std", _deviation),
        by_name(summary, "Effective", "average_effective_std", _deviation),
        by_name(summary, "Deviation", "average_fit_std", _deviation),
        ("Scatter", partial(_scatter, summary)),
        by_name(summary, "Offset", "offset", _deviation),
        by_name(summary, "Of fits", "fit_scatter", _deviation),
        ("Paper", partial(_their_std, paper)),
        ("Missed", lambda name: f"{summary[f'{name}.missed']:.0f} of {summary['resonances']:.0f}"),
    )
    caption = _MODEL_CAPTION.format(axes=" and ".join(found.study.axes))
    optimal = list(found.models).index(found.study.optimal)
    judged = "Models are judged by their scatter: the truth is known here."
    lead = " ".join((judged, *_contradictions(found, paper), *_too_sure(found, summary)))
    typical = [by_name(summary, head, f"typical_{key}", _deviation) for head, key in _TYPICAL.items()]
    tables = (
        table(columns, found.models, caption=caption, strong=optimal),
        table((columns[0], *typical), found.models, caption=_TYPICAL_CAPTION, strong=optimal),
    )
    return Section("Table II: costs and deviations", lead, tables)


_TYPICAL = {"Effective": "effective_std", "Deviation": "fit_std", "Scatter": "scatter", "Of fits": "fit_scatter"}
_TYPICAL_CAPTION = (
    "The same by geometric means over the springs: one that no data can tell, such as a gear with a bearing in"
    " series that the robot file lacks, outweighs all others in a plain mean."
)


def _too_sure(found: Found, summary: Mapping[str, float]) -> tuple[str, ...]:
    pairs = {name: (summary.get(f"{name}.scatter", 0.0), summary[f"{name}.average_fit_std"]) for name in found.models}
    return tuple(
        f"{name} states too little: it scatters by {_deviation(scattered)}, {significant(scattered / stated, 2)} times"
        f" its {_deviation(stated)}. What no nuisance parameter names takes others along."
        for name, (scattered, stated) in pairs.items()
        if scattered > _FURTHER * stated
    )


def _scatter(summary: Mapping[str, float], name: str) -> str:
    value, error = summary.get(f"{name}.scatter"), summary.get(f"{name}.scatter_error")
    beside = "" if value is None or error is None else f" ± {_deviation(value * error)}"
    return _deviation(value) + beside


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
        f" {reference.name}, which contains those of {', '.join(parts)}, must have smaller ones{held}. Yet the paper"
        f" prints {_their_std(paper, reference.name)} of it and"
        f" {', '.join(f'{_their_std(paper, name)} of {name}' for name in parts)}. What grows with the number of"
        " configurations is what a model lacks: a deviation that saturates in each, as the one that the fit states,"
        " is the honest one to compare.",
    )


def _their_std(paper: Mapping[str, Any], name: str) -> str:
    above = paper.get("average_std_above", {}).get(name)
    return percent(paper.get("average_std", {}).get(name)) if above is None else f"> {percent(above)}"


def _explanation_sections(found: Found) -> tuple[Section, ...]:
    explained = explained_springs(found)
    if not explained:
        return ()

    def over_slope(gear: str, name: str) -> str:
        own, slope = explained[name, gear]
        return percent(float(np.median(own / slope)) - 1, signed=True)

    gears = [(gear, partial(over_slope, gear)) for gear in dict.fromkeys(spring for _, spring in explained)]
    shown = table([("Model", partial(str)), *gears], dict.fromkeys(name for name, _ in explained))
    lead = (
        "A linear model finds the slope that a gear has where it was measured. Its springs against the mean slopes of"
        f" the model with stiffening gears, {found.study.nonlinear}, in the same configurations, though that was fitted"
        f" to those of {found.study.optimal} alone. Median distance:"
        f" {percent(summarise(found).get(f'{found.study.nonlinear}.explains_error'))}."
    )
    return (Section("Local models are slopes of the nonlinear one", lead, (shown,)),)


_EFFORT = (
    "Optimal: as many visits as tell most. Guess: its configurations in turn, by their own measurements. Random:"
    " candidates, median of 200 draws, and the worst tenth of them."
)
_OF_COSTS = "Costs in all configurations, each model's sorted; means over the individuals."
_MOST = 7
_MM = 1e3
_MAGNITUDE = ("Frequency [Hz]", "Magnitude [rad/(s² N m)]")


def _response_section(found: Found) -> Section:
    """Fig. 4: own responses of the axes in two configurations: where the linear model does best, and worst."""
    study = found.study
    error = np.abs(found.models[study.reference].resonance_error[0])
    error = np.where(found.there[0], np.where(np.isfinite(error), error, 1.0), 0.0).max(axis=1)
    names = dict.fromkeys([study.reference, study.optimal, study.guess, study.nonlinear])
    figures, data = [], found.first[study.reference]
    for configuration in (int(np.argmin(error)), int(np.argmax(error))):
        for axis, joint in enumerate(study.axes):
            at = (configuration, slice(None), axis)
            measured, band = data["measured"][at], 2 * data["deviation"][at]
            series = {
                "data": measured,
                "minus two deviations": np.maximum(measured - band, 1e-2 * measured),
                "plus two deviations": measured + band,
                **{name: found.first[name]["modelled"][at] for name in names if name is not None},
            }
            title = f"{joint}, configuration {configuration + 1}"
            figures.append(figure(title, _MAGNITUDE, data["frequency_hz"], series))
    lead = (
        f"The first individual. The two configurations in which {study.reference} meets the first resonances best and"
        " worst; magnitude of the motor's own response, torque to acceleration."
    )
    return Section("Fig. 4: responses and models", lead, (Beside(tuple(figures), 2),))


def _spring_section(found: Found) -> Section:
    figures = []
    for name, one in found.models.items():
        places = [found.springs.index(wanted.rpartition(".")[0]) for wanted in one.wanted]
        ratio = one.stiffness[0, places] / found.truth[0, places]
        ends = {"spring": ratio, "minus": ratio * np.exp(-2 * one.std[0]), "plus": ratio * np.exp(2 * one.std[0])}
        figures.append(figure(name, ("", ""), None, ends, log_x=False, log_y=False, height=220, legend=False))
    order = ", ".join(f"{number} {wanted.rpartition('.')[0]}" for number, wanted in enumerate(one.wanted, 1))
    lead = (
        "Springs of the first individual over their true linear stiffness (without what stiffening adds), two"
        f" deviations to each side. Along x: {order}."
    )
    return Section("Fig. 5: parameters and deviations", lead, (Beside(tuple(figures), 3),))


def _step_section(found: Found, summary: Mapping[str, float]) -> tuple[Section, ...]:
    if not found.steps:
        return ()
    steps, shown = found.steps[0], found.study.optimal

    def rms(factor: float, key: str, name: str) -> str:
        return significant(factor * summary[f"{name.replace(' ', '_')}.step_{key}"])

    columns = (
        ("Model", lambda name: name),
        ("Predicted displacement [mm]", partial(rms, _MM, "tool_rms_m")),
        ("Path [mm]", partial(rms, _MM, "path_rms_m")),
        ("Vibration [mm]", partial(rms, _MM, "vibration_m")),
        ("Predicted torque [N m]", partial(rms, 1.0, "torque_rms_nm")),
    )
    caption = (
        "Root mean squares over all axes and configurations, medians over the individuals: error of the displacement"
        " that the model predicts, distance of the true tool from the commanded path, vibration after the move, error"
        " of the predicted torque of the stepped axis."
    )
    lead = (
        f"Steps of {found.study.steps.step_deg:g} degree of each axis in {len(steps.configurations)} random"
        " configurations, motor motion and feed-forward from each model's flexible-joint inverse, the same feedback."
        " The paper's text breaks off before its figures."
    )
    figures = step_response_figures(steps, 0, 0, shown if shown in steps.models else steps.models[0])
    return (Section("Fig. 6: steps", lead, (table(columns, steps.models, caption=caption), Beside(figures, 2))),)


def deviation_figures(
    experiments: FloatArray, average: Mapping[str, FloatArray], worst: Mapping[str, FloatArray]
) -> tuple[Figure, ...]:
    """Shows how average and worst relative deviations (n_count,) of each set fall with the experiments (n_count,)."""
    titles = "Experiments", "Relative standard deviation [%]"
    return tuple(
        figure(f"{what} standard deviation", titles, experiments, {name: 100 * each for name, each in sets.items()})
        for what, sets in (("Average", average), ("Worst", worst))
    )


def step_response_figures(responses: StepResponses, configuration: int, axis: int, shown: str) -> tuple[Figure, ...]:
    """Shows one step: displacement and torque of the model `shown`, of all the errors of prediction and path."""
    at, stepped = (responses.models.index(shown), configuration, axis), (slice(None), configuration, axis)
    names = "rigid robot", "true robot", f"predicted by {shown}"
    off = responses.tool_error_m, responses.path_error_m
    reached = responses.path[configuration, axis], responses.tool_true[at], responses.tool_model[at]
    lengths = {name: _MM * np.linalg.norm(values, axis=-1) for name, values in zip(names, reached, strict=True)}
    torques = dict(zip(names[1:], (responses.torque_true[at], responses.torque_model[at]), strict=True))
    errors, paths = (dict(zip(responses.models, _MM * each[stepped], strict=True)) for each in off)
    return tuple(
        figure(title, ("Time [s]", unit), responses.time_s, series, log_x=False, log_y=False)
        for title, unit, series in (
            ("Tool displacement", "Displacement [mm]", lengths),
            (f"Motor torque of {responses.axes[axis]}", "Torque [N m]", torques),
            ("Error of the predicted displacement", "Distance [mm]", errors),
            ("Deviation from the path", "Distance [mm]", paths),
        )
    )

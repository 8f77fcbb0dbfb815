"""Figures of Zimmermann et al. (2023), drawn from our models, and those that the paper does not have."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid.arrays import FloatArray
from robid.pipeline.graph import Run
from robid.report.design import design_section
from robid.report.numbers import significant
from robid.report.section import Beside, Curve, Figure, Section, Table
from robid.robot.kinematics import skeleton
from robid.studies.zimmermann2023.effort import EffortCurves
from robid.studies.zimmermann2023.figures import Found
from robid.studies.zimmermann2023.models import chosen_designs
from robid.studies.zimmermann2023.steps import StepResponses

_MOST = 7
_MM = 1e3


def model_cost_section(found: Found) -> Section:
    """Fig. 3: sorted costs of every model, averaged over the individuals."""
    names, figures = list(found.models), []
    for part in (names[:_MOST], names[_MOST:]):
        shown = part if found.study.reference in part else [found.study.reference, *part]
        curves = []
        for name in shown:
            cost = np.sort(found.models[name].cost, axis=1).mean(axis=0)
            curves.append(Curve(name, tuple(np.arange(1.0, cost.size + 1).tolist()), tuple(cost.tolist())))
        if part:
            figures.append(Figure("", "Configuration, by its cost", "Cost", tuple(curves), log_x=False))
    lead = "Costs in all configurations, each model's sorted; means over the individuals."
    return Section("Fig. 3: costs of the validation", lead, (Beside(tuple(figures), 2),))


def response_section(found: Found) -> Section:
    """Fig. 4: own responses of the axes in two configurations: where the linear model does best, and worst."""
    study = found.study
    error = np.abs(found.models[study.reference].resonance_error[0])
    error = np.where(found.there[0], np.where(np.isfinite(error), error, 1.0), 0.0).max(axis=1)
    names = list(dict.fromkeys([study.reference, study.optimal, study.guess, study.nonlinear]))
    figures = []
    for configuration in (int(np.argmin(error)), int(np.argmax(error))):
        for axis, joint in enumerate(study.axes):
            at = (configuration, slice(None), axis)
            data = found.first[study.reference]
            measured, band = data["measured"][at], 2 * data["deviation"][at]
            curves = {
                "data": measured,
                "minus two deviations": np.maximum(measured - band, 1e-2 * measured),
                "plus two deviations": measured + band,
            }
            curves |= {name: found.first[name]["modelled"][at] for name in names if name is not None}
            title = f"{joint}, configuration {configuration + 1}"
            figures.append(_response(title, data["frequency_hz"], curves))
    lead = (
        f"The first individual. The two configurations in which {study.reference} meets the first resonances best and"
        " worst; magnitude of the motor's own response, torque to acceleration."
    )
    return Section("Fig. 4: responses and models", lead, (Beside(tuple(figures), 2),))


def _response(title: str, frequency_hz: FloatArray, curves: Mapping[str, FloatArray]) -> Figure:
    x = tuple(frequency_hz.tolist())
    drawn = tuple(Curve(name, x, tuple(values.tolist())) for name, values in curves.items())
    return Figure(title, "Frequency [Hz]", "Magnitude [rad/(s² N m)]", drawn)


def spring_section(found: Found) -> Section:
    """Fig. 5: springs over the truth, with two predicted deviations, of the first individual."""
    figures = []
    for name, one in found.models.items():
        places = [found.springs.index(wanted.rpartition(".")[0]) for wanted in one.wanted]
        ratio = one.stiffness[0, places] / found.truth[0, places]
        x = tuple(np.arange(1.0, ratio.size + 1).tolist())
        ends = {"spring": ratio, "minus": ratio * np.exp(-2 * one.std[0]), "plus": ratio * np.exp(2 * one.std[0])}
        curves = tuple(Curve(key, x, tuple(values.tolist())) for key, values in ends.items())
        figures.append(Figure(name, "", "", curves, log_x=False, log_y=False, height=220, legend=False))
    order = ", ".join(f"{number} {wanted.rpartition('.')[0]}" for number, wanted in enumerate(one.wanted, 1))
    lead = (
        "Springs of the first individual over their true linear stiffness (without what stiffening adds), two"
        f" deviations to each side. Along x: {order}."
    )
    return Section("Fig. 5: parameters and deviations", lead, (Beside(tuple(figures), 3),))


def effort_section(effort: EffortCurves) -> Section:
    """Deviations over the number of experiments."""
    figures = deviation_figures(effort.experiments, effort.average, effort.worst)
    lead = (
        f"{effort.sentence} Optimal: as many visits as tell most. Guess: its configurations in turn, by their own"
        " measurements. Random: candidates, median of 200 draws, and the worst tenth of them."
    )
    return Section("How long must I measure?", lead, (Beside(figures, 2),))


def design_sections(run: Run) -> tuple[Section, ...]:
    """The designs that the configurations come from: arms in space, weights, information, gap."""
    sections = []
    for name, design in chosen_designs(run).items():
        campaign = run.loaded.experiment.campaigns[run.loaded.experiment.designs[name].campaign]
        robot = run.loaded.robot.to_robot(campaign.payload_kg)
        sections.append(design_section(name, design, skeleton(robot, design.configurations)))
    return tuple(sections)


def step_section(found: Found, summary: Mapping[str, float]) -> tuple[Section, ...]:
    """Fig. 6: tool displacement after a step of the first axis, and errors of all models."""
    if not found.steps:
        return ()
    steps, shown = found.steps[0], found.study.optimal
    shown = shown if shown in steps.models else steps.models[0]
    rows = []
    for name in steps.models:
        key = name.replace(" ", "_")
        values = (summary[f"{key}.step_{part}"] for part in ("tool_rms_m", "path_rms_m", "vibration_m"))
        torque = significant(summary[f"{key}.step_torque_rms_nm"])
        rows.append((name, *(significant(_MM * value) for value in values), torque))
    heads = ("Model", "Predicted displacement [mm]", "Path [mm]", "Vibration [mm]", "Predicted torque [N m]")
    caption = (
        "Root mean squares over all axes and configurations, medians over the individuals: error of the displacement"
        " that the model predicts, distance of the true tool from the commanded path, vibration after the move, error"
        " of the predicted torque of the stepped axis."
    )
    count, size = len(steps.configurations), found.study.steps.step_deg
    lead = (
        f"Steps of {size:g} degree of each axis in {count} random configurations, motor motion and feed-forward from"
        " each model's flexible-joint inverse, the same feedback. The paper's text breaks off before its figures."
    )
    figures = step_response_figures(steps, 0, 0, shown)
    return (Section("Fig. 6: steps", lead, (Table(heads, tuple(rows), caption=caption), Beside(figures, 2))),)


def deviation_figures(
    experiments: FloatArray, average: Mapping[str, FloatArray], worst: Mapping[str, FloatArray]
) -> tuple[Figure, Figure]:
    """Shows how the parameters' deviations fall with the number of experiments, one curve for each set.

    Args:
        experiments (n_count,): Numbers of experiments.
        average: Average relative standard deviation (n_count,) by set.
        worst: Worst relative standard deviation (n_count,) by set.

    Returns:
        The figures of the average and of the worst, to stand beside each other.
    """
    x = tuple(float(count) for count in experiments)
    average_figure, worst_figure = (
        Figure(
            title=f"{what} standard deviation",
            x_title="Experiments",
            y_title="Relative standard deviation [%]",
            curves=tuple(Curve(name, x, tuple((100 * values).tolist())) for name, values in sets.items()),
        )
        for what, sets in (("Average", average), ("Worst", worst))
    )
    return average_figure, worst_figure


def step_response_figures(responses: StepResponses, configuration: int, axis: int, shown: str) -> tuple[Figure, ...]:
    """Shows one step: displacement and torque of one model, errors of all.

    Args:
        responses: All steps.
        configuration: Index of the configuration.
        axis: Index of the stepped axis.
        shown: Name of the model whose displacement and torque are drawn.

    Returns:
        Four figures, to stand in two columns: displacement, torque, error of the prediction, deviation from the path.
    """
    time, at = tuple(responses.time_s.tolist()), (responses.models.index(shown), configuration, axis)
    reached = {
        "rigid robot": responses.path[configuration, axis],
        "true robot": responses.tool_true[at],
        f"predicted by {shown}": responses.tool_model[at],
    }
    lengths = {name: _MM * np.linalg.norm(values, axis=-1) for name, values in reached.items()}
    torques = {"true robot": responses.torque_true[at], f"predicted by {shown}": responses.torque_model[at]}
    errors = {name: responses.tool_error_m[index, configuration, axis] for index, name in enumerate(responses.models)}
    paths = {name: responses.path_error_m[index, configuration, axis] for index, name in enumerate(responses.models)}
    motor = responses.axes[axis]
    drawn = (
        ("Tool displacement", "Displacement [mm]", lengths),
        (f"Motor torque of {motor}", "Torque [N m]", torques),
        ("Error of the predicted displacement", "Distance [mm]", {name: _MM * each for name, each in errors.items()}),
        ("Deviation from the path", "Distance [mm]", {name: _MM * each for name, each in paths.items()}),
    )
    return tuple(
        Figure(
            title,
            "Time [s]",
            unit,
            tuple(Curve(name, time, tuple(values.tolist())) for name, values in curves.items()),
            log_x=False,
            log_y=False,
        )
        for title, unit, curves in drawn
    )

"""Figures of a choice of configurations and of the models that it leads to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.report.charts import Skeletons
from robid.report.section import Bars, Curve, Figure
from robid.validation.steps import StepResponses

_MM = 1e3
_NO_WEIGHT = 1e-4


def skeleton_figure(
    points_m: FloatArray, weights: FloatArray, names: tuple[str, ...], candidates_m: FloatArray | None = None
) -> Skeletons:
    """Shows the chosen configurations as arms in space.

    Args:
        points_m (n_conf, n_point, 3): Points from base to tool [m].
        weights (n_conf,): Weight of each.
        names: Name of each.
        candidates_m (n_candidate, 3): Tool points of the candidates that were not chosen [m].
    """
    check_shape("points_m", points_m, "n_conf n_point xyz", n_conf=len(names), xyz=3)
    return Skeletons(
        title="The chosen configurations",
        names=names,
        points=tuple(_triples(arm) for arm in points_m),
        weights=tuple(weights.tolist()),
        others=() if candidates_m is None else _triples(candidates_m),
        caption="Drag to turn. A thicker arm has more weight; its tool is the large dot, the floor the grey plane.",
    )


def weight_figure(weights: FloatArray, names: tuple[str, ...]) -> Bars:
    """Shows the weight lambda of each candidate that has any."""
    pairs = zip(names, weights.tolist(), strict=True)
    shown = tuple((name, weight) for name, weight in pairs if weight >= _NO_WEIGHT)
    return Bars(
        title="Weights",
        value_title="\u03bb",
        labels=tuple(name for name, _ in shown),
        parts=(("\u03bb", tuple(weight for _, weight in shown)),),
        label_title="Configuration",
        caption="Shares of the experiments in the relaxed optimum; candidates without weight are left out.",
    )


def information_figure(information: FloatArray, parameters: tuple[str, ...], names: tuple[str, ...]) -> Bars:
    """Shows which configuration tells how much about which parameter.

    Args:
        information (n_conf, n_param): Weighted information of each configuration about each parameter, the diagonal.
        parameters: Name of each parameter.
        names: Name of each configuration.
    """
    shares = information / information.sum(axis=0)
    return Bars(
        title="Information per parameter",
        value_title="Share of the information",
        labels=parameters,
        parts=tuple((name, tuple(row.tolist())) for name, row in zip(names, shares, strict=True)),
        flat=True,
        caption="Weighted diagonal of the information matrices, other parameters taken as known.",
    )


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


def _triples(points: FloatArray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points)

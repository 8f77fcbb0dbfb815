"""Figures of a choice of configurations and of the models that it leads to."""

from __future__ import annotations

from robid.arrays import FloatArray, check_shape
from robid.report.charts import Skeletons
from robid.report.section import Bars

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


def _triples(points: FloatArray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points)

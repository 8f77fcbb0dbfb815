"""Correlation of a fit's parameters on its page: a heat map, and what the strongest pairs mean."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from scipy.sparse.csgraph import connected_components

from robid.arrays import FloatArray
from robid.report.charts import Heatmap
from robid.report.numbers import MINUS
from robid.report.parameters import Estimates, ParameterRow
from robid.report.section import Notes, Part, Section, Table
from robid.robot.parameters import FRICTION_KIND, PARAMETER_KINDS, name_of

STRONG = 0.95
"""Size of a correlation from which two parameters are hardly distinguished."""
_LEAD = (
    "How errors of two parameters go together: near 1 in size, the data determine a combination of the two better than"
    " either."
)
_TOGETHER = "both come out too large, or both too small: the data determine how the two compare, rather than each"
_AGAINST = "one comes out too large where the other comes out too small: the data determine what they give together"
_SEVERAL = "all come out too large, or all too small, together: the data determine how they compare, rather than each"
_MARKED = f"; those with {MINUS} go the other way"


def correlation_of(covariance: FloatArray) -> FloatArray:
    """Returns the correlation matrix (n_param, n_param) of a covariance; NaN where a variance is none or unknown."""
    variance = np.diag(covariance)
    known = np.isfinite(variance) & (variance > 0)
    std = np.sqrt(np.where(known, variance, np.nan))
    found = np.clip(covariance / np.outer(std, std), -1.0, 1.0)
    return np.asarray(np.where(np.isfinite(found), found, np.nan))


def correlation_section(estimates: Estimates) -> tuple[Section, ...]:
    """Lays out the correlation of a fit's parameters; nothing of fewer than two, or where no covariance is known."""
    if estimates.covariance is None:
        return ()
    rows, correlation = estimates.rows, correlation_of(np.asarray(estimates.covariance))
    # By kind as in the table of parameters; what is only estimated along is left out of the picture.
    kinds = list(dict.fromkeys(row.kind for row in estimates.shown))
    order = sorted(
        (
            place
            for place, row in enumerate(rows)
            if row.kind != FRICTION_KIND and np.isfinite(correlation[place, place])
        ),
        key=lambda place: kinds.index(rows[place].kind),
    )
    if len(order) < 2:
        return ()
    picture = Heatmap(
        title="",
        names=tuple(parameter_name(rows[place]) for place in order),
        values=tuple(tuple(row) for row in np.round(correlation[np.ix_(order, order)], 3).tolist()),
        value_title="r",
        groups=tuple(len(list(members)) for _, members in groupby(order, key=lambda place: rows[place].kind)),
        caption=_caption(estimates, len(rows) - len(order)),
    )
    return (Section("Correlation of parameters", _LEAD, (picture, *_groups(estimates, correlation)), "correlation"),)


def parameter_name(row: ParameterRow) -> str:
    """Names a parameter in full, with its kind."""
    return name_of(row.name, row.kind) if row.kind in PARAMETER_KINDS else row.name


def _caption(estimates: Estimates, left_out: int) -> str:
    whose = "physical values, as their intervals" if estimates.with_physical else "estimates, as their intervals"
    told = f"Correlation r by the covariance of the {whose}, ordered by kind; lines divide the kinds."
    more = f" {left_out} are left out: what is only estimated along, and what has no variance." if left_out else ""
    return told + more


def strong_groups(correlation: FloatArray) -> list[list[int]]:
    """Groups parameters that a chain of strong correlations (n_param, n_param) joins, the largest group first.

    Each group is led by the one whose correlations to the others are strongest.
    """
    size = np.abs(np.nan_to_num(correlation))
    count, label = connected_components(size > STRONG, directed=False)
    groups = [np.flatnonzero(label == each) for each in range(count)]
    led = [rows[np.argsort(-size[np.ix_(rows, rows)].sum(axis=1), kind="stable")] for rows in groups if rows.size > 1]
    return sorted((rows.tolist() for rows in led), key=len, reverse=True)


def _groups(estimates: Estimates, correlation: FloatArray) -> tuple[Part, ...]:
    """What strong correlations mean, a row for each pair or group, or that there is none."""
    rows, found = estimates.rows, strong_groups(correlation)
    if not found:
        return (Notes((f"No pair is correlated by more than {STRONG:g}: {_largest(rows, correlation)}.",)),)
    shown = tuple(_group(rows, correlation, members) for members in found)
    caption = (
        "A prediction that moves all of a row may be certain where each of them is not. To separate them, fix or tie"
        " one, or measure configurations in which they act differently. What joins many of them has one cause, such as"
        " a common scale of the recorded torques."
    )
    title = f"Correlated by more than {STRONG:g}"
    return (Table(("Parameters", "r", "What it means"), shown, title, caption, styles=("prose", "text", "prose")),)


def _group(rows: tuple[ParameterRow, ...], correlation: FloatArray, members: list[int]) -> tuple[str, str, str]:
    leader, *others = members
    values = correlation[leader, others]
    names = [parameter_name(rows[leader])]
    opposed = values < 0
    marked = opposed & (len(others) > 1)
    names += [f"{MINUS * bool(less)}{parameter_name(rows[row])}" for row, less in zip(others, marked, strict=True)]
    ends = [f"{value:.3f}".replace("-", MINUS) for value in (values.min(), values.max())]
    told = ends[0] if ends[0] == ends[1] else f"{ends[0]} … {ends[1]}"
    if len(members) == 2:
        return ", ".join(names), told, _AGAINST if opposed.any() else _TOGETHER
    return ", ".join(names), told, _SEVERAL + (_MARKED if opposed.any() else "")


def _largest(rows: tuple[ParameterRow, ...], correlation: FloatArray) -> str:
    first, second = np.triu_indices(len(correlation), 1)
    size = np.abs(np.nan_to_num(correlation[first, second]))
    at = int(np.argmax(size))
    value = f"{correlation[first[at], second[at]]:.3f}".replace("-", MINUS)
    return f"the strongest is {parameter_name(rows[first[at]])} with {parameter_name(rows[second[at]])}, {value}"

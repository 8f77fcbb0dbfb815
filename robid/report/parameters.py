"""The parameters of a fit as every family has them: rows of plain values, and how they are written."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import groupby
from statistics import median
from typing import Annotated

from robid.arrays import FloatArray, Meaning
from robid.report.numbers import MISSING, Scale, engineering, percent, scale_for, significant
from robid.robot.parameters import FRICTION_KIND, INTEGRATOR_KIND, NUISANCE_KIND, PARAMETER_KINDS


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of a fit, in SI units."""

    name: Annotated[str, Meaning("Name of the parameter.")]
    kind: Annotated[str, Meaning("Its kind, as `stiffness`, `damping`, `delay`.")]
    unit: Annotated[str, Meaning("SI unit of its values, as `N m/rad`.")]
    nominal: Annotated[
        float,
        Meaning(
            "Value in the robot file; 0 for kind `friction`, whose values are deviations from it; null where nobody"
            " knows it beforehand."
        ),
    ]
    estimate: Annotated[float, Meaning("Fitted value.")]
    lower: Annotated[float, Meaning("Lower end of the interval.")]
    upper: Annotated[float, Meaning("Upper end of the interval.")]
    relative_std: Annotated[float, Meaning("Relative standard deviation after the fit.")]
    truth: Annotated[float | None, Meaning("True value of a simulated robot.")] = None
    identifiable: Annotated[bool, Meaning("Whether the data determine it, fixed before the fit.")] = True
    covered: Annotated[bool | None, Meaning("Whether the interval contains the truth.")] = None
    assumed: Annotated[bool, Meaning("Whether the nominal value has no published source.")] = False
    note: Annotated[str, Meaning("What a reader should know, as why it is not identifiable.")] = ""
    bootstrap: Annotated[tuple[float, float] | None, Meaning("Lower and upper end of the bootstrap's interval.")] = None
    realization_relative_std: Annotated[
        float | None, Meaning("Relative deviation from the influence of each realization.")
    ] = None
    identified: Annotated[bool, Meaning("Whether it is identifiable and the interval after the fit bears it out.")] = (
        True
    )
    predicted_relative_std: Annotated[
        float | None, Meaning("Relative deviation predicted before the fit, which decides whether it is identifiable.")
    ] = None
    known_relative_std: Annotated[float | None, Meaning("Relative deviation known beforehand.")] = None
    physical: Annotated[
        float | None,
        Meaning("Middle of the interval, where it is distinguished from the estimate: the parameter itself."),
    ] = None
    effective: Annotated[
        tuple[float, float, float] | None,
        Meaning("Value, lower and upper end of what predicts best, where that is distinguished."),
    ] = None

    @property
    def middle(self) -> float:
        """The value that the interval from `lower` to `upper` is of."""
        return self.estimate if self.physical is None else self.physical

    @property
    def near(self) -> float:
        """Half width of the interval of what predicts, or of the only one."""
        lower, upper = (self.lower, self.upper) if self.effective is None else self.effective[1:]
        return (upper - lower) / 2


@dataclass(frozen=True)
class Estimates:
    """All parameters of a fit, and what holds for all of them."""

    rows: tuple[ParameterRow, ...] = ()  # the parameters, in the order to show
    level: float = 0.95  # level of the intervals
    torque_unit: str = "N m"  # what stands for N m where the torque constant is unknown
    misfit: float = 0.0  # cost over what noise and the assumed model error give
    undetermined: tuple[str, ...] = ()  # combinations of parameters that the data do not determine, a sentence each
    identifiable_relative_std: float | None = None  # predicted deviation up to which a parameter counts as identifiable
    interval_rule: str = ""  # what set the width of the intervals, in words
    about: str = ""  # what values are to be understood as, where that is no convention
    # Covariance (n_param, n_param) of what the intervals are of, in the order of the rows; None where it is unknown.
    covariance: FloatArray | None = field(default=None, compare=False)

    @property
    def with_nominal(self) -> bool:
        """Whether any of them was known beforehand."""
        return any(math.isfinite(row.nominal) for row in self.rows)

    @property
    def with_physical(self) -> bool:
        """Whether a parameter has a value of its own beside that which predicts."""
        return any(row.physical is not None for row in self.rows)

    @property
    def with_effective(self) -> bool:
        """Whether what predicts is told from what is there."""
        return any(row.effective is not None for row in self.rows)

    @property
    def shown(self) -> list[ParameterRow]:
        """Those that the model is made of; nuisances are apart."""
        return [row for row in self.rows if row.kind != FRICTION_KIND]


@dataclass(frozen=True)
class ParameterLine:
    """A parameter as text; the numbers share one scale."""

    name: str
    unit: str
    estimate: str
    lower: str
    upper: str
    truth: str
    covered: bool | None
    identified: bool
    note: str
    assumed: bool = False
    nominal: str = ""
    half_width: str = ""
    change: str = ""
    off_truth: str = ""
    bootstrap: str = ""
    predicts: str = ""
    physical: str = ""


def kind_title(kind: str, torque_unit: str = "N m") -> str:
    """Names a kind of parameters, as a ratio where the torque constant is unknown: `Springs, k/K_t`."""
    about = PARAMETER_KINDS.get(kind)
    if about is None:
        return kind
    return f"{about.title}, {about.symbol}/K_t" if torque_unit != "N m" and about.symbol else about.title


def ratio_sentence(torque_unit: str) -> str:
    """Says what the values are where the torque constant is unknown; empty where it is known."""
    if torque_unit == "N m":
        return ""
    return f"The torque constant K_t is unknown: {torque_unit} stands for N m, and every value is its ratio to K_t."


def rule_sentence(estimates: Estimates) -> str:
    """Says what set the width of the intervals; empty where that is unknown."""
    return f"The intervals' width is set by {estimates.interval_rule}." if estimates.interval_rule else ""


def effective_sentence(estimates: Estimates) -> str:
    """Says what the two intervals of a parameter are; empty where there is one."""
    if not estimates.with_effective:
        return ""
    if not estimates.with_physical:
        return (
            "“Estimate” is the value that predicts best, “estimate ±” half its interval relative to it. The interval"
            " beside it is that of the part itself: it also contains what the robot file may have wrong, as the torque"
            " constants of its motors."
        )
    return (
        "“Estimate” is the value that predicts other configurations best, “estimate ±” half its interval relative to"
        " it. “Physical” is the value of the part itself: its interval and ± also contain what the robot file may have"
        " wrong."
    )


def misfit_sentence(estimates: Estimates) -> str:
    """Says by how much the residual exceeds what is known of it; empty where it does not."""
    if estimates.misfit <= 1:
        return ""
    return (
        f"The residual is {significant(math.sqrt(estimates.misfit), 2)} times as large as noise and the assumed model "
        "error explain."
    )


def bootstrap_sentence(estimates: Estimates) -> str:
    """Compares the bootstrap's intervals with the tabled ones; empty without a bootstrap."""
    ratios = [
        (row.bootstrap[1] - row.bootstrap[0]) / 2 / row.near
        for row in estimates.rows
        if row.bootstrap is not None and row.identifiable and row.near > 0
    ]
    if not ratios:
        return ""
    return (
        f"The bootstrap over realizations gives intervals {significant(median(ratios), 2)} times as wide (median; "
        f"{significant(min(ratios), 2)} to {significant(max(ratios), 2)})."
    )


def parameter_line(row: ParameterRow, threshold: float | None = None) -> ParameterLine:
    """Writes a parameter; a row that is not identified says why."""
    if row.kind == FRICTION_KIND:
        return _nuisance_line(row, threshold)
    scale, predicts = scale_for(row.estimate or row.nominal, row.unit, row.near), ""
    if row.effective is not None:
        # Half the interval of what predicts over that value.
        predicts = percent(row.near / abs(row.effective[0]) if row.effective[0] else math.nan)
    return ParameterLine(
        name=row.name,
        unit=scale.unit,
        nominal=scale.text(row.nominal),
        estimate=scale.text(row.estimate),
        lower=scale.text(row.lower),
        upper=scale.text(row.upper),
        half_width=half_width_text(row),
        change=percent(row.estimate / row.nominal - 1, signed=True) if row.nominal else MISSING,
        truth=scale.text(row.truth),
        off_truth=percent(row.estimate / row.truth - 1, signed=True) if row.truth else MISSING,
        covered=row.covered,
        assumed=row.assumed,
        identified=row.identified,
        note=_note(row, threshold),
        bootstrap=f"{scale.text(row.bootstrap[0])} … {scale.text(row.bootstrap[1])}" if row.bootstrap else "",
        predicts=predicts,
        physical="" if row.physical is None else scale.text(row.physical),
    )


def _relative_half_width(row: ParameterRow) -> float:
    """Half the interval over the value it is of, or as it is for what the robot file's value is the zero of.

    It is not a number where the value is as good as zero.
    """
    size = 1.0 if row.kind == FRICTION_KIND else 0.0 if row.kind == INTEGRATOR_KIND else abs(row.middle)
    return (row.upper - row.lower) / 2 / size if size else float("nan")


def half_width_text(row: ParameterRow) -> str:
    """Writes half the interval, relative to the value; with its unit where it is wider than that, as in `8.2 µs`."""
    relative, width = _relative_half_width(row), (row.upper - row.lower) / 2
    if relative <= 1 or row.kind == INTEGRATOR_KIND or not math.isfinite(width):
        return percent(relative)
    return engineering(width, row.unit, width / 10)


def _nuisance_line(row: ParameterRow, threshold: float | None) -> ParameterLine:
    """Writes a deviation from the robot file, in percentage points or samples; there is nothing to relate it to."""
    factor, unit = (1, row.unit) if row.unit else (100, "%")
    half_width = factor * (row.upper - row.lower) / 2
    known = half_width > 0 and math.isfinite(half_width)
    decimals = min(max(1 - math.floor(math.log10(half_width)), 0), 3) if known else 3

    def text(value: float | None) -> str:
        rounded = None if value is None else round(factor * value, decimals)
        return Scale(0, unit, decimals).text(rounded)

    return ParameterLine(
        name=row.name,
        unit=unit,
        estimate=text(row.estimate),
        lower=text(row.lower),
        upper=text(row.upper),
        truth=text(row.truth),
        covered=row.covered,
        identified=row.identified,
        note=_note(row, threshold),
    )


def parameter_groups(estimates: Estimates) -> list[tuple[str, list[ParameterLine]]]:
    """Groups a fit's parameters by kind, in the order given; nuisances are apart."""
    order = list(dict.fromkeys(row.kind for row in estimates.shown))
    rows = sorted(estimates.shown, key=lambda row: order.index(row.kind))
    return [
        (
            kind_title(kind, estimates.torque_unit),
            [parameter_line(row, estimates.identifiable_relative_std) for row in group],
        )
        for kind, group in groupby(rows, key=lambda row: row.kind)
    ]


def nuisance_lines(estimates: Estimates) -> list[ParameterLine]:
    """Writes what the fit estimates only to get it out of the way: errors of the compensated torque."""
    return [
        parameter_line(row, estimates.identifiable_relative_std) for row in estimates.rows if row.kind == FRICTION_KIND
    ]


def _note(row: ParameterRow, threshold: float | None) -> str:
    """Says why a row is not to be relied on, with the figure that decided, before what else there is to know."""
    reason = _reason(row, threshold)
    return "; ".join(text for text in (reason, row.note) if text)


def _reason(row: ParameterRow, threshold: float | None) -> str:
    if row.kind == INTEGRATOR_KIND:
        return "an integrator"
    limit = 0.0 if threshold is None else threshold
    if row.identified:
        return ""
    if row.identifiable:
        return f"not identified: the interval came out at ±{half_width_text(row)}"
    decided = row.relative_std if row.predicted_relative_std is None else row.predicted_relative_std
    if decided > limit > 0:
        return f"not identifiable: predicted deviation {percent(decided)}, above {percent(limit)}"
    if row.known_relative_std is None:
        return f"not identifiable: predicted deviation {percent(decided)}"
    relied = row.known_relative_std <= limit and row.kind != NUISANCE_KIND
    known = "known beforehand" if relied else "not identifiable: known beforehand"
    return f"{known} to {percent(row.known_relative_std)}, and the data were predicted to leave {percent(decided)}"

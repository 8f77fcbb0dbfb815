"""Tables of a fit of gears: the gears, what is determined of them, and what each motion says."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.parameters import quantile
from robid.models.transmission.fit.law import LOST_MOTION_SHARE
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.judge.validating import TransmissionValidation
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import ColumnStyle, Section, Table
from robid.results.grade import DO_NOT_USE, WORDS, Grade

_ARC_MIN = 60 * 180 / np.pi


def gears_section(solution: TransmissionSolution, validation: TransmissionValidation | None, grade: Grade) -> Section:
    """Tabulates the gears as data sheets do, with what limits them."""
    columns: dict[str, list[str]] = {
        "Stiffness": [_with_interval(solution, f"{spring}.stiffness", 1e-6, "MN m/rad") for spring in solution.springs],
        **_steps(solution),
        "Lost motion": [
            _with_interval(solution, f"{joint}.lost_motion", _ARC_MIN, "arc min") for joint in solution.joints
        ],
        "Hysteresis": [
            _with_interval(solution, f"{joint}.hysteresis", _ARC_MIN, "arc min") for joint in solution.joints
        ],
        "Slope inside": [_slope_inside(solution, gear) for gear in range(len(solution.joints))],
        "Rated torque": [_rated(solution, gear) for gear in range(len(solution.joints))],
        "reached": [percent(each) for each in solution.reached / solution.rated],
        "Residual": [percent(each) for each in solution.residual / np.maximum(solution.size, 1e-300)],
    }
    if validation is not None:
        columns["Error, new"] = [percent(each) for each in validation.relative_error]
    columns["Grade"] = [_grade(solution, gear, grade) for gear in range(len(solution.joints))]
    rows = tuple(zip(solution.joints, *columns.values(), strict=True))
    numbers: tuple[ColumnStyle, ...] = ("number",)
    styles: tuple[ColumnStyle, ...] = ("name", *numbers * (len(columns) - 1), "text")
    caption = (
        f"Lost motion: between the loop's centre line at plus and minus {LOST_MOTION_SHARE:.0%} of the rated torque. "
        "Hysteresis: width of the loop at zero torque. Slope inside: where a small motion begins. "
        "Reached: largest torque behind the gear from its mean, over the rated one. "
        "Residual and error: of the deflection's size, root mean squares."
    )
    if any(".stiffness_" in name for name in solution.estimate.names):
        caption += " K2, K3: stiffness beyond the torques that `stiffness_torques_nm` states; *Stiffness* is K1."
    if not solution.rated_stated.all():
        caption += " m: no rated torque is stated, the largest in the records stands for it."
    table = Table(("Joint", *columns), rows, caption=caption, styles=styles)
    return Section("Gears", "What the gears are, from the angles of both of their sides.", (table,), "gears")


def _steps(solution: TransmissionSolution) -> dict[str, list[str]]:
    """Stiffness from each torque of a data sheet on; no column where no gear has any."""
    found: dict[str, list[str]] = {}
    most = max(
        sum(name.startswith(f"{joint}.stiffness_") for name in solution.estimate.names) for joint in solution.joints
    )
    for step in range(2, most + 2):
        names = [f"{joint}.stiffness_{step}" for joint in solution.joints]
        found[f"K{step}"] = [_with_interval(solution, name, 1e-6, "MN m/rad") for name in names]
    return found


def _slope_inside(solution: TransmissionSolution, gear: int) -> str:
    """Writes how steep the torque is within the loop, where a small motion begins; nothing without hysteresis."""
    value = dict(zip(solution.own_names, solution.values[gear].tolist(), strict=True))
    if value["slip"] <= 0:
        return MISSING
    scale = solution.largest[gear] / solution.guess[gear]
    slope = np.exp(value["stiffness"]) + value["slip"] * solution.largest[gear] / (np.exp(value["reach"]) * scale)
    return f"{significant(1e-6 * float(slope), 3)} MN m/rad"


def _rated(solution: TransmissionSolution, gear: int) -> str:
    mark = "" if solution.rated_stated[gear] else "m "
    return f"{mark}{significant(float(solution.rated[gear]), 3)} N m"


def _with_interval(solution: TransmissionSolution, name: str, factor: float, unit: str) -> str:
    """Writes a value with half its interval; nothing where the fit has no such parameter."""
    estimate = solution.estimate
    if name not in estimate.names:
        return MISSING
    at = estimate.names.index(name)
    half = 0.5 * factor * float(estimate.upper[at] - estimate.lower[at])
    if not np.isfinite(half) or half > 10 * abs(factor * float(estimate.value[at])):
        return "not identified"
    return f"{significant(factor * float(estimate.value[at]), 3)} ± {significant(half, 2)} {unit}"


def _grade(solution: TransmissionSolution, gear: int, grade: Grade) -> str:
    """How far to trust a gear: as the fit, but for those that nothing determines or that nothing is said against."""
    if not solution.determined[gear]:
        return "not determined"
    joint, spring = solution.joints[gear], solution.springs[gear]
    against = [each for each in grade.findings if joint in each.message or spring in each.message]
    if any(each.decisive for each in against):
        return WORDS[DO_NOT_USE]
    others = [each for each in grade.findings if each not in against]
    if not against and all(any(name in each.message for name in solution.joints) for each in others) and others:
        return "no finding"
    return WORDS[grade.value]


def sums_section(solution: TransmissionSolution) -> Section:
    """Tabulates sums that the motions determine, where their parts are known by what is stated beforehand alone."""
    half = quantile(solution.estimate.confidence)
    columns = (
        _sums(solution.lag_s, half * solution.lag_std_s, 1e3, "ms", 4),
        _sums(solution.damping_s, half * solution.damping_std_s, 1e3, "ms", 3),
        _sums(solution.loop, half * solution.loop_std, _ARC_MIN, "arc min", 3),
        _sums(solution.share, half * solution.share_std, 100.0, "%", 2),
    )
    rows = zip(solution.joints, *columns, strict=True)
    heads = (
        "Joint",
        "Lag + viscous / stiffness",
        "Damping / stiffness + torque lag",
        "Loop + Coulomb friction",
        "Share behind gear",
    )
    lead = (
        "To first order a motion shows these sums alone. How much of each is the encoders' lag, the gear's damping or "
        "its hysteresis, and how much friction behind the gear, follows from what is stated beforehand (`prior`)."
    )
    caption = (
        "Share behind gear: of the motor's friction, what acts behind the gear; zero is as the robot file states it."
    )
    return Section("What is determined", lead, (Table(heads, tuple(rows), caption=caption),), "sums")


def _sums(value: FloatArray, half: FloatArray, factor: float, unit: str, digits: int) -> list[str]:
    """Writes values (n_gear,) with half their intervals."""
    pairs = zip((factor * value).tolist(), (factor * half).tolist(), strict=True)
    return [f"{significant(own, digits)} ± {significant(off, 2)} {unit}" for own, off in pairs]


def motions_section(solution: TransmissionSolution, validation: TransmissionValidation | None) -> Section:
    """Tabulates the stiffness that each motion gives by itself."""
    half = quantile(solution.estimate.confidence)
    columns: dict[str, list[str]] = {}
    for motion, name in enumerate(solution.motions):
        columns[name or f"motion {motion + 1}"] = [
            _by_itself(float(solution.by_motion[gear, motion]), half * float(solution.by_motion_std[gear, motion]))
            for gear in range(len(solution.joints))
        ]
    if validation is not None:
        columns["validation"] = [
            _by_itself(*each)
            for each in zip(validation.stiffness.tolist(), (half * validation.stiffness_std).tolist(), strict=True)
        ]
    columns["Agreement"] = [significant(float(each), 2) for each in solution.agreement]
    columns["between"] = [percent(float(each)) for each in solution.between]
    rows = tuple(zip(solution.joints, *columns.values(), strict=True))
    lead = "Stiffness by each motion alone, in MN m/rad, with intervals without what all motions share."
    caption = (
        "Agreement: probability of such differences by noise alone. Between: deviation between motions beyond noise, "
        "which widens the intervals."
    )
    return Section("Motion by motion", lead, (Table(("Joint", *columns), rows, caption=caption),), "motions")


def _by_itself(stiffness: float, relative: float) -> str:
    if relative > 1:
        return "not identified"
    return f"{significant(1e-6 * stiffness, 4)} ± {percent(relative)}"

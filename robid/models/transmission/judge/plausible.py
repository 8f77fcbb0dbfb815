"""What speaks against a fit of gears by itself, and which gears it determines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.models.conclusions import graded_alone
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade

_DOUBTFUL_LOAD, _UNKNOWN_LOAD = 0.15, 0.5  # of a motor's torque that is left unexplained
_OTHER_TORQUE = 2.0  # recorded over modelled
_DOUBTFUL_RESIDUAL, _UNEXPLAINED = 0.1, 0.4  # of the deflection
_DISAGREE = 0.01
_FAR = 3.0  # deviations of what is known beforehand
_TOO_FAR = 5.0
_LONG_LAG_S = 0.015


def fit_findings(solution: TransmissionSolution, options: TransmissionFitOptions) -> tuple[Finding, ...]:
    """Returns what speaks against the gears that a fit determines, decisive findings first."""
    determined = np.flatnonzero(solution.determined).tolist()
    found = [*_torques(solution), *_undetermined(solution)]
    # A wrong ratio may be why a gear is not determined.
    for gear in range(len(solution.joints)):
        found += _scale(solution, options, gear)
    for gear in determined:
        found += [
            *_load(solution, gear),
            *_residual(solution, gear),
            *_motions(solution, gear, len(determined)),
            *_share(solution, options, gear),
            *_lag(solution, gear),
        ]
    return tuple(sorted(found, key=lambda each: (not each.decisive, -each.strength)))


def assess(solution: TransmissionSolution, options: TransmissionFitOptions) -> Grade:
    """Grades a fit by itself."""
    return graded_alone(fit_findings(solution, options), solution.estimate.status)


def _undetermined(solution: TransmissionSolution) -> Iterator[Finding]:
    if not solution.determined.any():
        told = f"the motions determine the stiffness of no gear: {'; '.join(remedies(solution))}"
        yield Finding("excitation", told, decisive=True, strength=3.0)


def remedies(solution: TransmissionSolution) -> list[str]:
    """Says of each gear whose stiffness is not identified which motion would tell it."""
    found, estimate = [], solution.estimate
    for gear in np.flatnonzero(~solution.determined).tolist():
        at = estimate.names.index(f"{solution.springs[gear]}.stiffness")
        lacking = float(estimate.relative_std[at] / estimate.identifiable_relative_std)
        reached = two_digits(float(solution.reached[gear]))
        found.append(
            f"the torque behind the gear of {solution.joints[gear]} varies by {reached} N m about its mean, and "
            f"{two_digits(max(lacking, 1.1))} times as much would tell its stiffness: accelerate it harder, or where "
            "gravity loads it go slowly through its range and back"
        )
    return found


def _torques(solution: TransmissionSolution) -> Iterator[Finding]:
    """Yields motor torques of another sign or size than bodies of any plausible mass would need."""
    for joint, ratio in zip(solution.joints, solution.torque_ratio.tolist(), strict=True):
        if ratio < -1 / _OTHER_TORQUE:
            told = f"the torque of {joint} is {two_digits(ratio)} times what the robot file's bodies and friction need"
            yield Finding("torque_sign", told, decisive=True, strength=10.0)
        elif not 1 / _OTHER_TORQUE < ratio < _OTHER_TORQUE:
            told = f"the torque of {joint} is {two_digits(ratio)} times what the robot file's bodies and friction need"
            size = abs(np.log(abs(ratio) + 1e-12)) / np.log(_OTHER_TORQUE)
            yield Finding("units", told, decisive=True, strength=float(size))


def _load(solution: TransmissionSolution, gear: int) -> Iterator[Finding]:
    left = float(solution.unexplained[gear])
    if left > _DOUBTFUL_LOAD:
        told = (
            f"bodies and friction leave {left:.0%} of the torque of {solution.joints[gear]} unexplained, so that what "
            "loads its gear is off: name a `rigid` fit that explains it"
        )
        yield Finding("masses", told, decisive=left > _UNKNOWN_LOAD, strength=left / _DOUBTFUL_LOAD)


def _scale(solution: TransmissionSolution, options: TransmissionFitOptions, gear: int) -> Iterator[Finding]:
    at = solution.own_names.index("scale")
    value, std = float(solution.values[gear, at]), options.prior.scale
    if std > 0 and abs(value) > _FAR * std:
        told = f"the arm of {solution.joints[gear]} moves {1 + value:.5g} times as its motor says through the gear"
        yield Finding("gear_ratio", told, decisive=abs(value) > _TOO_FAR * std, strength=abs(value) / (_FAR * std))


def _residual(solution: TransmissionSolution, gear: int) -> Iterator[Finding]:
    share = float(solution.residual[gear] / max(solution.size[gear], np.finfo(float).tiny))
    if share > _DOUBTFUL_RESIDUAL:
        told = f"the gear's law leaves {share:.0%} of the deflection of {solution.joints[gear]} unexplained"
        yield Finding("model", told, decisive=share > _UNEXPLAINED, strength=share / _DOUBTFUL_RESIDUAL)


def _motions(solution: TransmissionSolution, gear: int, count: int) -> Iterator[Finding]:
    probability = float(solution.agreement[gear])
    if probability < _DISAGREE / count:
        own = solution.by_motion[gear]
        told = (
            f"the motions give stiffnesses of {solution.springs[gear]} from {own.min():.3g} to {own.max():.3g} "
            "N m/rad, which differ by more than noise"
        )
        strength = 1 + float(np.log10(_DISAGREE / count / max(probability, 1e-12))) / 4
        yield Finding("unsteady", told, decisive=False, strength=strength)


def _share(solution: TransmissionSolution, options: TransmissionFitOptions, gear: int) -> Iterator[Finding]:
    std, value = options.prior.friction_share, float(solution.share[gear])
    if std > 0 and abs(value) > _FAR * std:
        told = (
            f"the encoders of {solution.joints[gear]} differ with the sense of its motion as if {value:.0%} of the "
            "motor's friction acted behind the gear: a coupling of its link encoder may be loose"
        )
        yield Finding("gear_nonlinearity", told, decisive=False, strength=abs(value) / (_FAR * std))


def _lag(solution: TransmissionSolution, gear: int) -> Iterator[Finding]:
    lag_s = float(solution.lag_s[gear])
    if abs(lag_s) > _LONG_LAG_S:
        told = f"the arm's encoder of {solution.joints[gear]} lags by {two_digits(1e3 * lag_s)} ms behind the motor's"
        yield Finding("delay", told, decisive=False, strength=abs(lag_s) / _LONG_LAG_S)

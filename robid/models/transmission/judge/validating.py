"""Gears on a motion that the fit never saw: the encoders' difference predicted, and the stiffness by it alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, Quantity
from robid.errors import DataError
from robid.models.conclusions import outcome_of, refuse_other_rate
from robid.models.transmission.fit.estimating import motion_by_motion
from robid.models.transmission.fit.gear import GearModel, gear_model
from robid.models.transmission.fit.gear_data import gear_data
from robid.models.transmission.fit.load import KnownBodies, load_of
from robid.models.transmission.fit.motions import Motion
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.fit.tracks import tracks_of
from robid.results.finding import Finding
from robid.results.outcome import Outcome
from robid.robot.description import Robot

ERROR_LIMIT = 0.3
"""Of a deflection's size, above which a gear's law does not predict it."""
_MATTERS, _WORSE = 0.05, 2.5
_FAR = 3.0  # deviations
_ROUNDS = 3


@dataclass(frozen=True)
class TransmissionValidation:
    """Gears on another motion."""

    outcome: Outcome
    time_s: Annotated[FloatArray, Quantity("s", "row", "Time, motions after each other")]
    measured: Annotated[FloatArray, Quantity("rad, or m", "row gear", "Encoders' difference, their lag taken out")]
    model: Annotated[FloatArray, Quantity("rad, or m", "row gear", "The model's")]
    relative_error: Annotated[FloatArray, Quantity("1", "gear", "Error over the size of the deflection")]
    expected: Annotated[FloatArray, Quantity("1", "gear", "Error that parameters and residual let expect, as that")]
    stiffness: Annotated[FloatArray, Quantity("N m/rad, or N/m", "gear", "Stiffness by this motion alone")]
    stiffness_std: Annotated[FloatArray, Quantity("1", "gear", "Its relative deviation without what both share")]
    deviations: Annotated[FloatArray, Quantity("1", "gear", "Its difference from the fit's over that of both")]


def validate_transmissions(
    robot: Robot,
    solution: TransmissionSolution,
    motions: Sequence[Motion],
    options: TransmissionFitOptions,
    findings: Sequence[Finding] = (),
    truth: Mapping[str, float] | None = None,
) -> TransmissionValidation:
    """Validates gears on motions that the fit never saw; limits are shares of the deflection's size.

    Raises:
        DataError: If the motions cannot be used, or are not of the same gears.
    """
    refuse_other_rate(solution.sampling_period_s, [motion.sampling_period_s for motion in motions])
    tracks, gears = tracks_of(motions, robot, options), motions[0].gears
    joints = tuple(robot.joints[gear].name for gear in gears)
    if joints != solution.joints:
        message = (
            f"D679 the validation has link encoders on {', '.join(joints)}, the fit on {', '.join(solution.joints)}"
        )
        raise DataError(message, where="validation", remedy="validate on records of the same encoders")
    bodies = KnownBodies(solution.bodies.names, solution.bodies.value, solution.bodies.directions)
    load = load_of(robot, gears, tracks, bodies)
    parts = []
    for column, joint in enumerate(gears):
        rated, steps = float(solution.rated[column]), options.stiffness_torques_nm.get(joints[column], ())
        data = gear_data(tracks, load, gears, column, float(robot.gear_ratio[joint]), rated, steps)
        model = gear_model(data, options, float(solution.guess[column]), float(solution.largest[column]))
        parts.append(_predicted(model, solution, column))
    measured, predicted, deflection = (np.stack([part[which] for part in parts], axis=1) for which in range(3))
    error = np.sqrt(np.mean((measured - predicted) ** 2, axis=0))
    logs, std, by_parameters = (np.array([part[which] for part in parts]) for which in (3, 4, 5))
    size = np.maximum(np.std(deflection, axis=0), np.finfo(float).tiny)
    own = np.sqrt(np.mean((solution.rows.measured - solution.rows.model) ** 2, axis=0))
    expected = np.sqrt(own**2 + by_parameters**2) / size
    expected = np.hypot(expected, options.prior.model_error)
    away = (logs - np.log([_stiffness(solution, gear) for gear in range(len(gears))])) / np.hypot(
        std, _effective_std(solution)
    )
    relative = error / size
    every = [*findings, *_doubts(solution, relative, expected, away)]
    failures = _failures(solution, relative)
    return TransmissionValidation(
        outcome=outcome_of(solution.estimate, every, failures, _verdict(solution, relative, failures), truth),
        time_s=np.concatenate([track.time_s for track in tracks]),
        measured=measured,
        model=predicted,
        relative_error=relative,
        expected=expected,
        stiffness=np.exp(logs),
        stiffness_std=std,
        deviations=away,
    )


def _predicted(
    model: GearModel, solution: TransmissionSolution, column: int
) -> tuple[FloatArray, FloatArray, FloatArray, float, float, float]:
    """Measured and predicted differences and the gear's part (n_row,), and the stiffness by these motions alone.

    Last comes the error that the parameters' covariance lets expect, root mean square. Only what a motion begins with
    is its own: the state of the hysteresis.
    """
    known = dict(zip(solution.own_names, solution.values[column].tolist(), strict=True))
    value = np.array([0.0 if name.startswith(("start_", "doubt_")) else known.get(name, 0.0) for name in model.names])
    starts = [place for place, name in enumerate(model.names) if name.startswith("start_") and model.std[place] > 0]
    for _ in range(_ROUNDS if starts else 0):
        measured, predicted, slopes = model.predict(value)
        moved = np.linalg.lstsq(slopes[:, starts], measured - predicted, rcond=1e-6)[0]
        value[starts] = np.clip(value[starts] + moved, -1.0, 1.0)
    point = model.predict(value)
    logs, std = motion_by_motion(model, value, point)
    weights = 1 / std**2
    mean = float(weights @ logs / weights.sum())
    places = [model.place(name) if name in model.names else -1 for name in solution.own_names]
    slopes = np.where(np.array(places) >= 0, point[2][:, places], 0.0)
    slopes[:, [name.startswith("start_") for name in solution.own_names]] = 0.0
    variance = np.einsum("rp,pq,rq->r", slopes, solution.values_covariance[column], slopes)
    expected = float(np.sqrt(np.mean(variance)))
    return point[0], point[1], model.deflection(value), mean, float(weights.sum() ** -0.5), expected


def _at(solution: TransmissionSolution, gear: int) -> int:
    return solution.estimate.names.index(f"{solution.springs[gear]}.stiffness")


def _stiffness(solution: TransmissionSolution, gear: int) -> float:
    return float(solution.estimate.value[_at(solution, gear)])


def _effective_std(solution: TransmissionSolution) -> FloatArray:
    """Relative deviations (n_gear,) of the stiffnesses without what both motions share, with those between motions."""
    lower, upper = solution.estimate.effective_interval
    places = [_at(solution, gear) for gear in range(len(solution.joints))]
    half = 0.5 * np.log(upper[places] / lower[places])
    return np.hypot(half / 1.96, solution.between)


def _failures(solution: TransmissionSolution, relative: FloatArray) -> tuple[str, ...]:
    bad = np.flatnonzero(solution.determined & (relative > ERROR_LIMIT)).tolist()
    return tuple(
        f"the deflection of {solution.joints[gear]} is off by {relative[gear]:.0%} of its size, limit {ERROR_LIMIT:.0%}"
        for gear in bad
    )


def _doubts(
    solution: TransmissionSolution, relative: FloatArray, expected: FloatArray, away: FloatArray
) -> Iterator[Finding]:
    ratio = relative / expected
    for gear in np.flatnonzero(solution.determined).tolist():
        joint = solution.joints[gear]
        if relative[gear] > _MATTERS and ratio[gear] > _WORSE:
            told = (
                f"the deflection of {joint} is off by {ratio[gear]:.2g} times what residual and parameters let expect"
            )
            yield Finding("model", told, decisive=False, strength=float(ratio[gear]) / _WORSE)
        if abs(away[gear]) > _FAR:
            told = (
                f"the new motion gives a stiffness of {solution.springs[gear]} that is off by {abs(away[gear]):.2g} "
                "deviations of both"
            )
            yield Finding("unsteady", told, decisive=False, strength=float(abs(away[gear])) / _FAR)


def _verdict(solution: TransmissionSolution, relative: FloatArray, failures: tuple[str, ...]) -> str:
    if failures:
        return f"does not predict a new motion: {'; '.join(failures)}"
    if not solution.determined.any():
        return "determines no gear"
    worst = int(np.argmax(np.where(solution.determined, relative, -np.inf)))
    return (
        f"predicts a new motion: the deflection of {solution.joints[worst]} is off by {relative[worst]:.2g} of its"
        " size, others by less"
    )

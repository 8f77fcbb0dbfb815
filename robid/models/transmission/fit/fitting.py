"""A fit of gears step by step: motions, what loads the gears, each gear's law, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import norm

from robid.arrays import BoolArray, FloatArray
from robid.models.transmission.fit.estimating import GearEstimate, estimate_gear
from robid.models.transmission.fit.gear import GearModel, gear_model
from robid.models.transmission.fit.gear_data import gear_data
from robid.models.transmission.fit.load import KnownBodies, Load, load_of
from robid.models.transmission.fit.motions import Motion
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.solution import Bodies, Loops, Rows, TransmissionSolution
from robid.models.transmission.fit.told import Sums, Told, loop_of, spring_name, told_of
from robid.models.transmission.fit.tracks import Track, tracks_of
from robid.results.estimate import Estimate
from robid.robot.description import Robot

RULE = "residuals and what loads the gear"
_ADVICE = "the search did not end by itself: record longer, or leave parts out of `gear`"


@dataclass(frozen=True)
class FittedGear:
    """One gear with all that was found of it."""

    model: GearModel
    found: GearEstimate
    told: tuple[Told, ...]
    sums: Sums


def fit_transmissions(
    robot: Robot, motions: Sequence[Motion], options: TransmissionFitOptions, known: KnownBodies | None = None
) -> TransmissionSolution:
    """Fits the gears of all joints with encoders on both sides.

    Args:
        robot: The robot file's robot with its payload.
        motions: The motions, of one sampling period.
        options: Options of the fit.
        known: Bodies of a rigid fit, in place of the robot file's.

    Raises:
        DataError: If the motions cannot be used.
    """
    tracks, gears = tracks_of(motions, robot, options), motions[0].gears
    load = load_of(robot, gears, tracks, known)
    rated, stated = rated_torques(robot, gears, load, options)
    fitted = []
    for column, joint in enumerate(gears):
        steps = options.stiffness_torques_nm.get(robot.joints[joint].name, ())
        data = gear_data(tracks, load, gears, column, float(robot.gear_ratio[joint]), float(rated[column]), steps)
        model = gear_model(data, options, first_stiffness(tracks, load, column))
        found = estimate_gear(model)
        fitted.append(FittedGear(model, found, *told_of(robot, model, found)))
    return _solution(robot, motions, tracks, load, options, fitted, (rated, stated))


def first_stiffness(tracks: Sequence[Track], load: Load, column: int) -> float:
    """A first guess of a gear's stiffness: the straight line through its deflection, lag and offset beside it."""
    rows, target = [], []
    for track, torque in zip(tracks, load.torque, strict=True):
        speed, position = track.shown.speed[:, column], track.shown.position[:, column]
        rows.append(np.stack([torque[:, column], speed, np.ones(len(speed))], axis=1))
        target.append(track.geared.position[:, column] - position)
    stacked = np.concatenate(rows)
    size = np.linalg.norm(stacked, axis=0)
    size[size == 0] = 1.0
    compliance = np.linalg.lstsq(stacked / size, np.concatenate(target), rcond=1e-8)[0][0] / size[0]
    largest = float(np.abs(stacked[:, 0]).max())
    return float(1 / max(abs(compliance), 1e-7 / max(largest, 1e-9)))


def rated_torques(
    robot: Robot, gears: Sequence[int], load: Load, options: TransmissionFitOptions
) -> tuple[FloatArray, BoolArray]:
    """Rated torques (n_gear,) at the gears' outputs, and whether they are stated; else the largest of the records."""
    found, stated = [], []
    for column, gear in enumerate(gears):
        joint = robot.joints[gear]
        own = options.rated_torque_nm.get(joint.name)
        if own is None and joint.motor.rated_torque_nm is not None:
            own = abs(joint.motor.gear_ratio) * joint.motor.rated_torque_nm
        stated.append(own is not None)
        found.append(max(float(np.abs(each[:, column]).max()) for each in load.torque) if own is None else own)
    return np.array(found), np.array(stated, bool)


def _solution(
    robot: Robot,
    motions: Sequence[Motion],
    tracks: Sequence[Track],
    load: Load,
    options: TransmissionFitOptions,
    fitted: Sequence[FittedGear],
    rated: tuple[FloatArray, BoolArray],
) -> TransmissionSolution:
    gears = list(motions[0].gears)
    sums = {name: np.array([getattr(each.sums, name) for each in fitted]) for name in Sums.__dataclass_fields__}
    places = [each.model.place("share") for each in fitted]
    loops = [loop_of(each.model, each.found.value) for each in fitted]
    torques = np.concatenate(load.torque)
    left = [each.found.measured - each.found.model for each in fitted]
    laws = [each.model.deflection(each.found.value) for each in fitted]
    return TransmissionSolution(
        estimate=estimate_of(fitted, options),
        joints=tuple(robot.joints[gear].name for gear in gears),
        springs=tuple(spring_name(robot, gear) for gear in gears),
        motions=tuple(track.name for track in tracks),
        sampling_period_s=motions[0].sampling_period_s,
        rated=rated[0],
        rated_stated=rated[1],
        reached=np.abs(torques - torques.mean(axis=0)).max(axis=0),
        **sums,
        share=np.array([each.found.value[place] for each, place in zip(fitted, places, strict=True)]),
        share_std=np.array(
            [np.sqrt(each.found.covariance[place, place]) for each, place in zip(fitted, places, strict=True)]
        ),
        by_motion=np.exp([each.found.motions for each in fitted]),
        by_motion_std=np.array([each.found.motions_std for each in fitted]),
        agreement=np.array([each.found.agreement for each in fitted]),
        between=np.array([each.found.between for each in fitted]),
        residual=np.array([np.sqrt(np.mean(each**2)) for each in left]),
        size=np.array([np.std(each) for each in laws]),
        unexplained=load.unexplained[gears],
        gain=load.gain[gears],
        torque_ratio=load.ratio[gears],
        own_names=fitted[0].model.names[: fitted[0].model.n_own],
        values=np.array([each.found.value[: each.model.n_own] for each in fitted]),
        values_covariance=np.array([each.found.covariance[: each.model.n_own, : each.model.n_own] for each in fitted]),
        guess=np.array([each.model.largest / each.model.scale for each in fitted]),
        largest=np.array([each.model.largest for each in fitted]),
        bodies=Bodies(load.bodies.names, load.bodies.value, load.bodies.directions),
        rows=Rows(
            time_s=np.concatenate([track.time_s for track in tracks]),
            motion=np.repeat(np.arange(len(tracks)), [len(track.time_s) for track in tracks]),
            torque=torques,
            measured=np.stack([each.found.measured for each in fitted], axis=1),
            model=np.stack([each.found.model for each in fitted], axis=1),
            deflection=np.stack(laws, axis=1),
        ),
        loops=Loops(
            torque=np.stack([loop.torque for loop in loops], axis=1),
            deflection=np.stack([loop.deflection[:, 0] for loop in loops], axis=1),
        ),
    )


def estimate_of(fitted: Sequence[FittedGear], options: TransmissionFitOptions) -> Estimate:
    """Puts the parameters of all gears together; those of different gears share only what loads them."""
    told = [row for each in fitted for row in each.told]
    covariance, effective = (
        block_diag(*(_of_told(each, getattr(each.found, name)) for each in fitted))
        for name in ("covariance", "effective")
    )
    value, usual = np.array([row.value for row in told]), np.array([row.usual for row in told])
    std, near = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(effective))
    half, relative = float(norm.ppf(0.5 + 0.5 * options.confidence)), std / usual
    lower, upper = _interval(told, half * std)
    effective_lower, effective_upper = _interval(told, half * near)
    converged = all(each.found.converged for each in fitted)
    return Estimate(
        names=tuple(row.name for row in told),
        kinds=tuple(row.kind for row in told),
        units=tuple(row.unit for row in told),
        nominal=np.array([row.nominal for row in told]),
        value=value,
        lower=lower,
        upper=upper,
        covariance=covariance,
        degrees_of_freedom=np.full(len(told), np.inf),
        confidence=options.confidence,
        interval_rule=RULE,
        relative_std=relative,
        predicted_relative_std=relative,
        prior_relative_std=np.full(len(told), np.inf),
        relative_half_width=half * relative,
        identifiable=relative <= options.identifiable_relative_std,
        identifiable_relative_std=options.identifiable_relative_std,
        undetermined=(),
        status="converged" if converged else "iteration_limit",
        advice="" if converged else _ADVICE,
        physical_value=value,
        effective_value=value,
        effective_lower=effective_lower,
        effective_upper=effective_upper,
    )


def _of_told(gear: FittedGear, covariance: FloatArray) -> FloatArray:
    moves = np.array([row.moves * (row.value if row.logarithmic else 1.0) for row in gear.told])
    return np.asarray(moves @ covariance @ moves.T)


def _interval(told: Sequence[Told], half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends (n_told,) of intervals, of what is positive those of its logarithm."""
    value = np.array([row.value for row in told])
    logarithmic = np.array([row.logarithmic for row in told], bool)
    ratio = np.exp(np.minimum(half / np.where(logarithmic, value, 1.0), 50.0))
    return np.where(logarithmic, value / ratio, value - half), np.where(logarithmic, value * ratio, value + half)

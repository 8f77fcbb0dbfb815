"""Wrong units and other scales of a record, told from its torques and motions before the fit."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.models.rigid.fit.cut_off import motion_band
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.rows import prepare
from robid.models.rigid.fit.shots import Shot, positions_of
from robid.results.finding import Finding, two_digits
from robid.results.plausible.hypotheses import Hypothesis, Pair, Seen, hypotheses_of, joined, name_scales, pairs_of
from robid.results.plausible.scales import named_finding
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import RigidModel, build_rigid_model
from robid.signals.filters import central_differences
from robid.signals.quantities import QUANTITIES, Channel
from robid.signals.record import Record

_ROWS = 300
_COURSE = 1000  # samples at least of each shot that tell how far it moved
_WIDER, _HIGHEST = 4.0, 0.2
_BODIES = ("inertia", "first_moment", "mass", "motor_inertia", "coupling_inertia")
_VISIBLE = 0.1
_COMMON_STD, _PART_STD = 0.35, 0.6
_ERROR_STD, _UNLIKE_STD, _BEYOND_STD = 0.12, 0.5, 0.3
_PAIR_STD, _CONTRADICTED = 0.03, 4.0
_TRUNCATED = 1e-4
_USUAL_PERIOD_S, _PERIOD_STD = 1e-3, 2.3
_USUAL_TRAVEL, _TRAVEL_STD = 0.4, 1.5
_LEAST_TRAVEL, _MOST_TRAVEL = 0.005, 3.0
_LEAST_LIKENESS = 0.5


@dataclass(frozen=True)
class Motions:
    """What a record says of the joints' motions."""

    channels: tuple[Channel, ...]  # all channels of motions of the joints
    used: IntArray  # (n_joint,): which of them the fit reads
    pairs: tuple[Pair, ...]  # those that measure the same motion, compared; indices of `channels`


def motions_of(record: Record, robot: Robot) -> Motions:
    """Reads from a record what it says of a robot's joints' motions."""
    names = {joint.name for joint in robot.joints}
    own = [
        index
        for index, channel in enumerate(record.output_channels)
        if channel.name.partition(".")[0] in names
        and channel.side != "tool"
        and QUANTITIES[channel.quantity].derivatives is not None
    ]
    pairs = [
        replace(pair, first=own.index(pair.first), second=own.index(pair.second)) for pair in pairs_of(record, robot)
    ]
    used = [own.index(index) for index in positions_of(record, robot)]
    return Motions(tuple(record.output_channels[index] for index in own), np.array(used, int), tuple(pairs))


def rigid_scale_findings(
    robot: Robot, shots: Sequence[Shot], motions: Motions, options: RigidFitOptions
) -> tuple[Finding, ...]:
    """Returns the wrong scale that a record shows, at most one.

    Torques are explained by the model as it would be under each mistake: by gravity, which times do not change, and by
    inertia, which angles, times and torques do. What a record's channels say of each other counts too, and how far the
    arm would have moved.
    """
    try:
        scene = _Scene(robot, shots, motions, options)
    except ValueError:  # too short for any filter, which the fit says
        return ()
    names = [joint.name for joint in robot.joints]
    stated = [joint.motor.torque_constant_nm_a for joint in robot.joints]
    constant = np.array([np.nan if one is None else one for one in stated])
    hypotheses = hypotheses_of(names, motions.channels, robot.gear_ratio, constant)
    named = name_scales([each for each in hypotheses if scene.may_be(each)], scene.told, scene.likely())
    return () if named is None else (named_finding(named, scene.sources(named.alike[0].log)),)


class _Scene:
    """What a record says of scales, seen by each hypothesis."""

    def __init__(self, robot: Robot, shots: Sequence[Shot], motions: Motions, options: RigidFitOptions) -> None:
        self._robot, self._shots, self._motions = robot, shots, motions
        self._n_joint = len(robot.joints)
        self._n_state = self._n_joint + len(motions.channels) + 1
        self._places = self._n_joint + motions.used
        self._model: RigidModel = build_rigid_model(robot, options.model)
        base = find_base_parameters(self._model, options.base)
        self._columns = self._model.only(base.columns.tolist())
        self._nominal = base.values(self._model.nominal)
        self._bodies = np.isin(np.array(self._columns.kinds), _BODIES)
        self._rows = thinned(shots, options)
        self._course = [shot.position[:: max(1, len(shot.position) // _COURSE)] for shot in shots]
        self._pairs = self._paired()
        self._seen: dict[bytes, Seen] = {}

    def may_be(self, hypothesis: Hypothesis) -> bool:
        """Whether a hypothesis is worth a trial: no other channel contradicts it, nor how far the joints move."""
        travel, reach = self._travel(np.exp(hypothesis.log[self._places]))
        share = np.where(np.isfinite(reach), travel / reach, _USUAL_TRAVEL)
        moves = hypothesis.log[self._places] == 0
        likely = moves | ((share > _LEAST_TRAVEL) & (share < _MOST_TRAVEL))
        return bool(likely.all()) and self._pairs.farthest(hypothesis.log) < _CONTRADICTED

    def told(self, log: FloatArray) -> Seen:
        """What the data decide, seen by a hypothesis."""
        key = np.concatenate([log[self._places], log[-1:]]).tobytes()
        if key not in self._seen:
            self._seen[key] = self._dynamics(np.exp(log[self._places]), float(np.exp(log[-1])))
        seen = self._seen[key]
        # What the model says of undone motions is put as what it says of those that were read.
        here = log.copy()
        here[: self._n_joint] = 0.0
        return joined([replace(seen, value=seen.value + seen.rows @ here), self._pairs])

    def likely(self) -> Seen:
        """What is usual: sampling periods, and motions over some tenths of the joints' ranges."""
        rows, values, stds = (
            [self._row({-1: 1.0})],
            [np.log(self._shots[0].sampling_period_s / _USUAL_PERIOD_S)],
            [_PERIOD_STD],
        )
        travel, reach = self._travel(np.ones(self._n_joint))
        for joint in np.flatnonzero(np.isfinite(reach) & (travel > 0)).tolist():
            rows.append(self._row({int(self._places[joint]): 1.0}))
            values.append(np.log(travel[joint] / reach[joint] / _USUAL_TRAVEL))
            stds.append(_TRAVEL_STD)
        return Seen(np.array(rows), np.array(values), np.diag(np.square(stds)))

    def sources(self, log: FloatArray) -> str:
        """What speaks of a hypothesis, in words."""
        exact = (self._pairs.rows @ log).any()
        return "other channels of the same motion say" if exact else "the robot file explains"

    def _row(self, exponents: dict[int, float]) -> FloatArray:
        row = np.zeros(self._n_state)
        for index, exponent in exponents.items():
            row[index] += exponent
        return row

    def _paired(self) -> Seen:
        rows = [
            self._row({self._n_joint + pair.first: 1.0, self._n_joint + pair.second: -1.0, -1: -pair.derivatives})
            for pair in self._motions.pairs
        ]
        values = [np.log(pair.ratio) for pair in self._motions.pairs]
        stds = [max(_PAIR_STD, 3 * pair.relative_std) for pair in self._motions.pairs]
        shape = (len(rows), self._n_state)
        return Seen(np.reshape(rows, shape), np.reshape(values, len(rows)), np.diag(np.square(stds)))

    def _travel(self, motion: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far each joint would have moved, and may (n_joint,) [rad, or m], where motors were read `motion` times.

        Motors that turn several joints move them all.
        """
        ends = [(one / motion @ self._robot.arm_per_motor.T) for one in self._course]
        travel = np.max([one.max(axis=0) for one in ends], axis=0) - np.min([one.min(axis=0) for one in ends], axis=0)
        return np.asarray(travel), np.asarray(self._robot.upper - self._robot.lower)

    def _dynamics(self, motion: FloatArray, time: float) -> Seen:
        """What the model says where motions and times that were read are so many times true ones.

        Rows without exponents say how badly a hypothesis explains the torques at all.
        """
        position, velocity, acceleration, torque = self._rows
        path = position / motion, velocity / motion * time, acceleration / motion * time**2
        load = torque if self._columns.needs_torque else None
        still_path = path[0], 0 * path[1], 0 * path[2]
        whole, still = (self._columns.columns(*one, torque=load) for one in (path, still_path))
        values, share = _explained(whole, torque)
        travel, reach = self._travel(motion)
        beyond = np.log(np.maximum(np.where(np.isfinite(reach), travel / reach, 1.0), 1.0))
        # What each row's value goes with, the value in deviations or as a logarithm, and whether it is one.
        found: list[tuple[dict[int, float], float, bool]] = [({}, share / _ERROR_STD, False)]
        for joint in range(self._n_joint):
            found.append(({}, float(beyond[joint]) / _BEYOND_STD, False))
            # Gravity goes with the torque alone, inertia with torque time^2 / motion.
            inertial = {joint: 1.0, int(self._places[joint]): -1.0, -1: 2.0}
            for columns, exponents in ((still, {joint: 1.0}), (whole - still, inertial)):
                own = columns[:, joint, self._bodies]
                both = own @ values[self._bodies], own @ self._nominal[self._bodies]
                ratio, likeness = _compare(*both, torque[:, joint])
                if np.isnan(likeness):
                    continue
                found.append(({}, (1 - likeness) / _UNLIKE_STD, False))
                if likeness > _LEAST_LIKENESS and self._shots[0].torque_unit == "N m":
                    found.append((exponents, float(np.log(ratio)), True))
        levels = np.array([is_level for *_, is_level in found])
        # All levels share an error: the robot file's masses may be off alike.
        covariance = np.where(levels[:, None] & levels, _COMMON_STD**2, 0.0)
        covariance += np.diag(np.where(levels, _PART_STD**2, 1.0))
        rows = np.array([self._row(exponents) for exponents, *_ in found])
        return Seen(rows, np.array([value for _, value, _ in found]), covariance)


def thinned(shots: Sequence[Shot], options: RigidFitOptions) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Some hundred rows of filtered positions, speeds, accelerations and torques (n_row, n_joint)."""
    each = max(1, _ROWS // len(shots))
    parts: list[list[FloatArray]] = [[], [], [], []]
    for shot in shots:
        for part, values in zip(parts, _filtered(shot, options.filters), strict=True):
            part.append(values[np.unique(np.linspace(0, len(values) - 1, each).round().astype(int))])
    position, velocity, acceleration, torque = (np.concatenate(part) for part in parts)
    return position, velocity, acceleration, torque


def _filtered(shot: Shot, options: PreprocessingOptions) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Filtered positions, speeds, accelerations and torques (n_sample, n_joint) of a shot.

    The cut-off is that of the fit, or, where a wrong time makes nonsense of it, some times the motion's band.
    """
    period = shot.sampling_period_s
    band_hz = min(_WIDER * float(motion_band([shot], derivative=2).max()), _HIGHEST / period)
    cut_hz = band_hz if options.position_cut_hz is None else options.position_cut_hz
    for one in (cut_hz, band_hz):
        if not 0 < one <= _HIGHEST / period:
            continue
        filters = replace(options, position_cut_hz=one, drop_deviations=0.0)
        with suppress(ValueError):
            made = prepare(shot.position, shot.torque, period, filters, held=shot.held)
            first, last = made.reach + 1, len(shot.position) - made.reach - 1
            around = made.smooth(shot.position, first - 1, last + 1)
            torque = np.vstack([shot.torque[:1], made.centred_torque(1, len(shot.torque))])
            return around[1:-1], *central_differences(around, period), made.smooth(torque, first, last)
    message = "no filter fits the record"
    raise ValueError(message)


def solved(columns: FloatArray, torque: FloatArray) -> FloatArray:
    """Least squares over columns of size 1; what the motion hardly shows stays out."""
    matrix = columns.reshape(-1, columns.shape[-1])
    size = np.linalg.norm(matrix, axis=0)
    size = np.where(size > 0, size, 1.0)
    matrix = matrix / size
    power, turned = np.linalg.eigh(matrix.T @ matrix)
    inverse = np.divide(1.0, power, out=np.zeros_like(power), where=power > _TRUNCATED**2 * power[-1])
    return np.asarray(turned @ (inverse * (turned.T @ (matrix.T @ torque.ravel()))) / size)


def _explained(columns: FloatArray, torque: FloatArray) -> tuple[FloatArray, float]:
    """Parameters (n_param,) that explain torques (n_row, n_joint) best, and the share of these that is left."""
    scale = np.maximum(torque.std(axis=0), 1e-300)
    values = solved(columns / scale[:, None], torque / scale)
    left = (columns @ values - torque) / scale
    return values, float(np.linalg.norm(left) / np.linalg.norm((torque - torque.mean(axis=0)) / scale))


def _compare(estimated: FloatArray, stated: FloatArray, torque: FloatArray) -> tuple[float, float]:
    """Ratio and likeness of two courses of a torque, their means taken out; NaN where neither is a part of it."""
    estimated, stated = estimated - estimated.mean(), stated - stated.mean()
    sizes = np.linalg.norm(estimated), np.linalg.norm(stated)
    whole = np.linalg.norm(torque - torque.mean())
    if min(sizes) <= 0 or max(sizes) < _VISIBLE * whole:
        return np.nan, np.nan
    likeness = float(estimated @ stated / (sizes[0] * sizes[1]))
    # What is in proportion counts, not what else an estimate makes of it.
    return float(abs(estimated @ stated) / (stated @ stated)), likeness


_UNEXPLAINED = 0.15
_BETTER = 0.4
_CLEARLY = 0.7  # of what the next best leaves


def sum_findings(robot: Robot, shots: Sequence[Shot], options: RigidFitOptions) -> tuple[Finding, ...]:
    """Names an angle that looks like the sum or the difference of two joints', at most one.

    Controllers show some axes against the horizontal, though their motors turn them against the link before. Where
    the torques are badly explained, they are explained again with each angle less or plus each other.
    """
    if len(robot.joints) < 2:
        return ()
    try:
        rows = thinned(shots, options)
    except ValueError:
        return ()
    before = _unexplained(_base_model(robot, options), rows)
    if before < _UNEXPLAINED:
        return ()
    free = replace(robot, joints=tuple(replace(joint, couplings={}) for joint in robot.joints))
    model = _base_model(free, options)
    tried = [
        (_unexplained(model, changed), joint, other, sign) for changed, joint, other, sign in _changed(robot, rows)
    ]
    tried.sort(key=lambda one: one[0])
    (share, joint, other, sign), following = tried[0], [each for each in tried[1:] if each[1] != tried[0][1]]
    if share > _BETTER * before or any(share > _CLEARLY * each[0] for each in following):
        return ()
    told = f"the torques are explained to {_percent(share)} instead of {_percent(before)} "
    return (Finding("gear_coupling", told + _what(robot, joint, other, sign), decisive=True, strength=before / share),)


def _base_model(robot: Robot, options: RigidFitOptions) -> RigidModel:
    model = build_rigid_model(robot, options.model)
    return model.only(find_base_parameters(model, options.base).columns.tolist())


def _changed(
    robot: Robot, rows: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
) -> Iterator[tuple[tuple[FloatArray, ...], int, int, int]]:
    """Rows of a robot without couplings: each arm's motion less or plus each other's; the arms' own where none is."""
    *motions, torque = rows
    arms = [motion @ robot.arm_per_motor.T for motion in motions]
    coupled = any(joint.couplings for joint in robot.joints)
    if coupled:
        yield (*(arm * robot.gear_ratio for arm in arms), torque), -1, -1, 0
        return
    for (joint, other), sign in itertools.product(itertools.permutations(range(len(robot.joints)), 2), (1, -1)):
        other_way = np.eye(len(robot.joints))
        other_way[joint, other] = -sign
        yield (*(arm @ other_way.T * robot.gear_ratio for arm in arms), torque), joint, other, sign


def _unexplained(model: RigidModel, rows: tuple[FloatArray, ...]) -> float:
    """Share of the torques that no parameters explain."""
    position, velocity, acceleration, torque = rows
    columns = model.columns(position, velocity, acceleration, torque=torque if model.needs_torque else None)
    return _explained(columns, torque)[1]


def _what(robot: Robot, joint: int, other: int, sign: int) -> str:
    names = [one.name for one in robot.joints]
    ratio = robot.gear_ratio
    if sign:
        weights = {(joint, other): -sign * ratio[joint] / ratio[other]}
        kind = "sum" if sign > 0 else "difference"
        told = f"if the angle of {names[joint]} is the {kind} of those of {names[joint]} and {names[other]}: "
    else:
        turns = (robot.arm_per_motor - np.diag(1 / ratio)) * ratio[:, None]
        weights = {(row, column): turns[row, column] for row, column in np.argwhere(turns).tolist()}
        listed = ", ".join(dict.fromkeys(names[row] for row, _ in weights))
        told = (
            f"if the motors of {listed} turn their own joints alone, and only their logged angles count others' too: "
            "leave `couplings` out of the robot file, and "
        )
    sums = [
        f"`<{names[row]}> {'+' if weight > 0 else '-'} {abs(weight):.6g}*<{names[column]}>`"
        for (row, column), weight in weights.items()
    ]
    listed = " and ".join(sums)
    return (
        f"{told}state as its `variable` {listed}, of the log's variables of the motors (weights of 1 where arms' are)"
    )


def _percent(share: float) -> str:
    return f"{two_digits(100 * share)} %"

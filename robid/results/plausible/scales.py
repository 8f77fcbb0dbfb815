"""Wrong units, sides and times of a log: what its channels say of each other and of the robot file, before any fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.results.finding import Finding
from robid.results.plausible.evidence import Evidence
from robid.results.plausible.hypotheses import Named, Seen, hypotheses_of, joined, name_scales
from robid.results.scale import channels_of, mistake
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.quantities import QUANTITIES

_MOST_CONFIGURATIONS = 8
_LEAST_LINES = 3
_COMMON_STD, _CHANNEL_STD, _ELEMENT_STD, _COUPLING_STD = 0.4, 0.3, 0.4, 0.7
"""How far responses of robots with rough files are off, as logarithms: all alike, a motor's, an element's."""

_TINY = 1e-300
_USUAL_SCATTER, _LEAST_SCATTER = 0.3, 0.4

_SLOPE_STD, _PAIR_STD, _GRAVITY_STD = 0.01, 0.03, 0.5
_LEAST_SPREAD = {"rad": float(np.deg2rad(5.0)), "m": 0.025}
_SCATTER = 0.1
_LIKE_GRAVITY = 0.9
_USUAL_PERIOD_S, _PERIOD_STD = 1e-3, 2.3
_USUAL_TORQUE, _TORQUE_STD = 0.15, 1.5
_USUAL_SPEED, _SPEED_STD = 0.1, 2.0


@dataclass(frozen=True)
class Scales:
    """What a campaign says of its scales."""

    findings: tuple[Finding, ...]  # The wrong one, if there is one
    evidence: Evidence  # What the campaign would have shown without


def judge_scales(robot: Robot, evidence: Evidence, declared_s: float) -> Scales:
    """Finds the wrong scale that a campaign's channels show, at most one.

    Two encoders of one joint, mean angles against stated configurations, mean torques against gravity and the
    response of motors and arms against the robot file's each tell a product of powers of scales. What explains all of
    them is looked for among the mistakes that people make.

    Args:
        robot: The robot file's.
        evidence: What the campaign shows.
        declared_s: Nominal delay, hold excluded [s].
    """
    scene = _Scene(robot, evidence, declared_s)
    ratio = robot.gear_ratio[evidence.joints(robot)]
    hypotheses = hypotheses_of(evidence.names, evidence.moved, ratio, scene.torque_constant)
    named = name_scales(hypotheses, scene.told, scene.likely())
    if named is None:
        return Scales((), evidence)
    log = named.alike[0].log
    n_motor = len(evidence.names)
    motion = log[n_motor:-1][[[one.name for one in evidence.moved].index(name) for name in evidence.names]]
    undone = evidence.undone(np.exp(log[:n_motor]), np.exp(motion), float(np.exp(log[-1])))
    return Scales((named_finding(named, scene.sources(log)),), undone)


class _Scene:
    """What a campaign says of scales, by read over true time."""

    def __init__(self, robot: Robot, evidence: Evidence, declared_s: float) -> None:
        self._robot, self._evidence = robot, evidence
        self._joints = evidence.joints(robot)
        self._n_motor, self._n_moved = len(evidence.names), len(evidence.moved)
        self._n_state = self._n_motor + self._n_moved + 1
        self._derivatives = [float(QUANTITIES[one.quantity].derivatives or 0) for one in evidence.moved]
        n_conf = len(evidence.configurations)
        self._chosen = np.unique(np.linspace(0, n_conf - 1, min(n_conf, _MOST_CONFIGURATIONS)).round().astype(int))
        model = build_model(robot, balanced=True)
        names = tuple(one.name for one in evidence.moved)
        rest = solve_statics(model, evidence.configurations[self._chosen])
        self._names = names
        self._linear: LinearModel = linearize(model, rest, names)
        self._delay_s = declared_s
        self._fixed = [self._pairs(), self._slopes(), self._gravity()]
        self._levels: dict[float, Seen] = {}
        self._told: dict[float, Seen] = {}

    def told(self, log: FloatArray) -> Seen:
        """What the data decide, seen by a hypothesis."""
        time = float(np.exp(log[-1]))
        if time not in self._told:
            self._levels[time] = self._level(time)
            self._told[time] = joined([self._levels[time], *self._fixed])
        return self._told[time]

    def likely(self) -> Seen:
        """What is usual: sampling periods, and torques and speeds of some tenths of what motors can do."""
        evidence, motors = self._evidence, [self._robot.joints[index].motor for index in self._joints]
        rows, values, stds = (
            [self._row({-1: 1.0})],
            [np.log(evidence.sampling_period_s / _USUAL_PERIOD_S)],
            [_PERIOD_STD],
        )
        limits = np.array([motor.max_torque_nm for motor in motors])
        if evidence.torque_rms is not None and evidence.torque_unit == "N m" and np.isfinite(limits).all():
            mean = 0.0 if evidence.mean_torque is None else evidence.mean_torque
            size = np.sqrt(evidence.torque_rms**2 + np.square(mean)).mean(axis=0)
            for motor, share in enumerate((size / limits).tolist()):
                rows.append(self._row({motor: 1.0}))
                values.append(np.log(max(share, 1e-12) / _USUAL_TORQUE))
                stds.append(_TORQUE_STD)
        fastest = np.array([motor.max_speed_rad_s for motor in motors])
        if evidence.motion_rms is not None and np.isfinite(fastest).all():
            speed = evidence.motion_rms.mean(axis=0) * 2 * np.pi * float(evidence.lines_hz.min())
            for motor, share in enumerate((speed / fastest).tolist()):
                place = self._place(evidence.names[motor])
                rows.append(self._row({place: 1.0, -1: -1.0}))
                values.append(np.log(max(share, 1e-12) / _USUAL_SPEED))
                stds.append(_SPEED_STD)
        return _seen(rows, values, np.diag(np.square(stds)), self._n_state)

    @property
    def torque_constant(self) -> FloatArray:
        """Torque constants (n_motor,) as the robot file states them, NaN where it does not [N m/A]."""
        stated = [self._robot.joints[index].motor.torque_constant_nm_a for index in self._joints]
        return np.array([np.nan if one is None else one for one in stated])

    def sources(self, log: FloatArray) -> str:
        """What speaks of a hypothesis, in words, the most exact first."""
        level = self._levels[float(np.exp(log[-1]))]
        words = (
            "the joint's other encoder and the gear ratio",
            "the stated configurations and the gear ratio",
            "the arm's weight",
            "the robot file's inertias",
        )
        found = [word for word, seen in zip(words, (*self._fixed, level), strict=True) if (seen.rows @ log).any()]
        return " and ".join([", ".join(found[:-1]), found[-1]] if len(found) > 1 else found) + " say"

    def _row(self, exponents: dict[int, float]) -> FloatArray:
        row = np.zeros(self._n_state)
        for index, exponent in exponents.items():
            row[index] = exponent
        return row

    def _place(self, name: str) -> int:
        """Index of a motion among the states."""
        return self._n_motor + [one.name for one in self._evidence.moved].index(name)

    def _level(self, time: float) -> Seen:
        """Responses over the robot file's, whose springs and inertias may be off by factors of two and three.

        The lower and the upper half of the band say so apart: masses decide the one, rotors the other.
        """
        evidence = self._evidence
        rows, values, places = [], [], []
        if evidence.torque_unit == "N m":
            medians, counts = _medians_of_halves(*self._away(time))
            for row, column, half in np.argwhere(counts >= _LEAST_LINES).tolist():
                own = evidence.moved[row].name.removesuffix(".arm") == evidence.names[column]
                rows.append(self._row({self._n_motor + row: 1.0, column: -1.0, -1: -self._derivatives[row]}))
                values.append(float(medians[row, column, half]))
                places.append((row, column, own))
        driven = [value for value, (row, _, own) in zip(values, places, strict=True) if own and self._is_motor(row)]
        # A file is rough in each of its values: those that are off alike are off for another reason.
        alike = float(np.clip(np.std(driven) / _USUAL_SCATTER, _LEAST_SCATTER, 1.0)) if len(driven) > 1 else 1.0
        return _seen(rows, values, alike * _level_covariance(places), self._n_state)

    def _is_motor(self, row: int) -> bool:
        return self._evidence.moved[row].name in self._evidence.names

    def _away(self, time: float) -> tuple[FloatArray, BoolArray]:
        """Logarithm of measured over nominal responses (n_conf, n_line, n_moved, n_motor), and which of it is seen.

        Torques of a wrong scale leave nonsense once friction is subtracted, sound ones leave friction before: what
        follows the robot file better of both is taken.
        """
        evidence, joints = self._evidence, self._joints
        parameters = nominal_parameters(self._robot, self._linear, self._delay_s)
        nominal = np.abs(response(self._linear, parameters, evidence.spread_hz * time, None).sampled[..., joints])
        usable = evidence.spread_clear[self._chosen] & (nominal > 0)
        found = [
            np.log(np.maximum(np.abs(one[self._chosen]), _TINY)) - np.log(np.maximum(nominal, _TINY))
            for one in (evidence.spread, evidence.uncompensated)
        ]
        rows = [self._place(name) - self._n_motor for name in evidence.names if name in self._names]
        columns = [index for index, name in enumerate(evidence.names) if name in self._names]
        spread = [float(np.std(one[:, :, rows, columns], axis=1).mean()) if rows else 0.0 for one in found]
        return found[int(np.argmin(spread))], usable

    def _pairs(self) -> Seen:
        """Two encoders of one joint: below its antiresonance the arm follows the motor by the gear ratio.

        Motor over arm is `1 - w^2/w_a^2` there, a line over the squared frequency, of which the end is taken.
        """
        evidence, rows, values, stds = self._evidence, [], [], []
        names = [one.name for one in evidence.moved]
        for motor, name in enumerate(evidence.names):
            if f"{name}.arm" not in names or name not in names:
                continue
            first, second = names.index(name), names.index(f"{name}.arm")
            ratio = abs(float(self._robot.gear_ratio[self._joints[motor]]))
            found = _low_end(evidence, first, second, motor)
            if found is None:
                continue
            size, std = found
            more = self._derivatives[first] - self._derivatives[second]
            rows.append(self._row({self._n_motor + first: 1.0, self._n_motor + second: -1.0, -1: -more}))
            values.append(np.log(size / ratio))
            stds.append(max(_PAIR_STD, std))
        return _seen(rows, values, np.diag(np.square(stds)), self._n_state)

    def _slopes(self) -> Seen:
        """Mean angles over those of the stated configurations."""
        evidence, rows, values, stds = self._evidence, [], [], []
        if evidence.mean_angle is not None and len(evidence.configurations) > 2:
            stated = evidence.configurations @ self._robot.motor_per_arm[self._joints].T
            for motor, name in enumerate(evidence.names):
                joint = int(self._joints[motor])
                least = _LEAST_SPREAD["m" if self._robot.prismatic[joint] else "rad"]
                ratio = abs(float(self._robot.gear_ratio[joint]))
                found = _slope(stated[:, motor] / ratio, evidence.mean_angle[:, motor] / ratio, least)
                if found is not None:
                    rows.append(self._row({self._place(name): 1.0}))
                    values.append(np.log(found[0]))
                    stds.append(max(_SLOPE_STD, found[1]))
        return _seen(rows, values, np.diag(np.square(stds)), self._n_state)

    def _gravity(self) -> Seen:
        """Mean torques over those that hold the robot file's arm, where they go with them."""
        evidence, rows, values = self._evidence, [], []
        if evidence.mean_torque is not None and evidence.torque_unit == "N m" and len(evidence.configurations) > 2:
            model = build_model(self._robot, balanced=True)
            held = solve_statics(model, evidence.configurations).motor_torque[:, self._joints]
            for motor in range(self._n_motor):
                expected, measured = held[:, motor], evidence.mean_torque[:, motor]
                size = float(np.linalg.norm(expected) * np.linalg.norm(measured))
                if size > 0 and np.abs(expected).max() > 1e-9 and abs(expected @ measured) > _LIKE_GRAVITY * size:
                    rows.append(self._row({motor: 1.0}))
                    values.append(np.log(np.linalg.norm(measured) / np.linalg.norm(expected)))
        covariance = np.full((len(rows), len(rows)), _GRAVITY_STD**2 / 2) + np.eye(len(rows)) * _GRAVITY_STD**2 / 2
        return _seen(rows, values, covariance, self._n_state)


def _seen(rows: list[FloatArray], values: list[float], covariance: FloatArray, n_state: int) -> Seen:
    size = len(rows)
    return Seen(np.reshape(rows, (size, n_state)), np.reshape(values, size), np.reshape(covariance, (size, size)))


def _medians_of_halves(values: FloatArray, usable: BoolArray) -> tuple[FloatArray, IntArray]:
    """Medians (n_moved, n_motor, 2) of what is usable in the lower and the upper half of the band, and how many.

    Args:
        values (n_conf, n_line, n_moved, n_motor): Values.
        usable (n_conf, n_line, n_moved, n_motor): Which of them count.
    """
    middle, (n_moved, n_motor) = values.shape[1] // 2, values.shape[2:]
    medians, counts = np.empty((n_moved, n_motor, 2)), np.empty((n_moved, n_motor, 2), int)
    for half, lines in enumerate((slice(None, middle), slice(middle, None))):
        # Sorted, what does not count comes last.
        ranked = np.sort(np.where(usable, values, np.nan)[:, lines].reshape(-1, n_moved, n_motor), axis=0)
        count = usable[:, lines].sum(axis=(0, 1))
        ranks = np.maximum(np.stack([count - 1, count]) // 2, 0)
        medians[..., half] = np.take_along_axis(ranked, ranks, axis=0).mean(axis=0) if len(ranked) else np.nan
        counts[..., half] = count
    return medians, counts


def _level_covariance(places: list[tuple[int, int, bool]]) -> FloatArray:
    """How far the levels of a sound campaign with a rough robot file are off."""
    if not places:
        return np.zeros((0, 0))
    row, column, own = np.array(places).T
    alike = (row[:, None] == row).astype(float) + (column[:, None] == column)
    return np.asarray(
        _COMMON_STD**2 + _CHANNEL_STD**2 * alike + np.diag(np.where(own > 0, _ELEMENT_STD, _COUPLING_STD) ** 2)
    )


def _low_end(evidence: Evidence, first: int, second: int, motor: int) -> tuple[float, float] | None:
    """First over second motion where the frequency goes to zero, with its relative deviation."""
    x, y = evidence.spread[:, :, first, motor], evidence.spread[:, :, second, motor]
    clear = evidence.spread_clear[:, :, first, motor] & evidence.spread_clear[:, :, second, motor] & (np.abs(y) > 0)
    lines = np.flatnonzero(clear.all(axis=0))[:8]
    if lines.size < 4:
        return None
    ratio = (x[:, lines] / y[:, lines]).real
    ratio = np.median(ratio, axis=0) if len(ratio) > 2 else ratio.mean(axis=0)
    matrix = np.stack([np.ones(lines.size), (evidence.spread_hz[lines] / evidence.spread_hz[lines[-1]]) ** 2], axis=1)
    solution = np.linalg.lstsq(matrix, ratio, rcond=None)[0]
    left = ratio - matrix @ solution
    std = float(np.sqrt(left @ left / (lines.size - 2) * np.linalg.inv(matrix.T @ matrix)[0, 0]))
    size = abs(float(solution[0]))
    return (size, 3 * std / size) if size > 0 and std < 0.1 * size else None


def _slope(stated: FloatArray, logged: FloatArray, least: float) -> tuple[float, float] | None:
    """Slope of logged over stated angles, with its relative deviation; None where they do not go with each other."""
    x, y = stated - stated.mean(), logged - logged.mean()
    if np.sqrt((x**2).mean()) < least:
        return None
    slope = float(x @ y / (x @ x))
    left = y - slope * x
    if slope == 0 or np.sqrt(left @ left) > _SCATTER * abs(slope) * np.sqrt(x @ x):
        return None
    return abs(slope), 3 * float(np.sqrt(left @ left / max(len(x) - 2, 1) / (x @ x))) / abs(slope)


def named_finding(named: Named, sources: str) -> Finding:
    """Says what was seen, what it would mean and what to write."""
    size, low, high = named.seen
    first = named.alike[0].scales
    meant = [mistake(each.scales, each.factor) for each in named.alike]
    other = tuple(scale for scale in first if scale.inverse != first[0].inverse)
    # What makes nonsense of the rest may leave nothing that shows how large the factor is.
    times = f"{size:.4g} [{low:.4g}, {high:.4g}] times" if np.isfinite(high) else "not"
    told = (
        f"values of the {channels_of([scale for scale in first if scale not in other])} are {times} what {sources}, "
        f"{f'those of the {channels_of(other)} the inverse of that, ' if other else ''}as if {'; or '.join(meant)}"
    )
    scales = tuple(scale for each in named.alike for scale in each.scales)
    return Finding("units", told, decisive=True, strength=max(named.strength, 2.0), scales=scales)

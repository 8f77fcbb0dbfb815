"""Transmission errors of gears: their arms do not follow their motors evenly.

A gear's spring, damper and bristles see `delta + e(theta)`: its deflection and a sum of sines of the joint's own motor
angle, in arm units. The energy `U(delta + e(theta))` gives the torque `T = U'(delta + e)` on the arm, and
`-T (A^T + e'(theta))` on the motors. The engine knows `U(delta)` alone; here is what it lacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.robot.linearize import Equilibrium
from robid.robot.model import HYSTERESIS_SHARE, ElasticModel
from robid.simulate.options import Imperfections

_APART = 1.0  # Between the phases of a joint and the next [rad]
_MOST_TURN = 2.0  # Of a period in a sample: 1 - sin(1)/1 = 16 % more than the mean over the sample [rad]


@dataclass(frozen=True)
class GearError:
    """`e(theta) = sum_m a_m sin(k_m theta + phase_m)` of the gears of a robot that have one."""

    springs: IntArray  # (n_gear,) Their springs among the robot's
    joints: IntArray  # (n_gear,) Their joints
    order: FloatArray  # (n_wave,) Periods per motor turn
    amplitude: FloatArray  # (n_wave,) Amplitudes, arm side [rad]
    phase: FloatArray  # (n_gear, n_wave) Phases [rad]

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns error (..., n_gear) [rad] and its derivative by the motor angle, at motor angles (..., n_gear)."""
        turn = angle[..., None] * self.order + self.phase
        return np.sin(turn) @ self.amplitude, np.cos(turn) @ (self.order * self.amplitude)


def gear_error(robot: Robot, flaws: Imperfections) -> GearError | None:
    """Returns the error of a robot's gears; None where there is none."""
    phases = dict(enumerate(flaws.transmission_error_phase_rad, start=1))
    waves = [(float(m), size, phases.get(m, 0.0)) for m, size in enumerate(flaws.transmission_error_rad, start=1)]
    waves.append((flaws.gear_error_order, flaws.gear_error_rad, flaws.gear_error_phase_rad))
    order, amplitude, phase = np.array([wave for wave in waves if wave[1]], float).reshape(-1, 3).T
    rows = [
        row
        for row, spring in enumerate(robot.springs)
        if spring.place == "transmission" and not robot.is_linear(spring)
    ]
    if not (order.size and rows):
        return None
    joints = np.array([robot.springs[row].joint for row in rows])
    return GearError(np.array(rows), joints, order, amplitude, phase + _APART * joints[:, None])


class _Gears:
    """Spring, damper and bristles of gears, of the deflections that they see."""

    def __init__(self, model: ElasticModel, rows: IntArray, flaws: Imperfections) -> None:
        springs, engine = [model.robot.springs[row] for row in rows], model.mujoco
        tendons = [engine.tendon(spring.name).id for spring in springs]
        self._dead_band = engine.tendon_lengthspring[tendons, 1].copy()
        self._linear, self._cubic, self._damping = (
            np.array([getattr(spring, kind) for spring in springs]) for kind in ("stiffness", "cubic", "damping")
        )
        self._one_sided, self._growth = flaws.one_sided, flaws.load_damping_1_rad
        self.bristles = HYSTERESIS_SHARE * self._linear  # (n_gear,) Stiffness of the bristles [N m/rad]
        self.slip = flaws.hysteresis_nm / self.bristles  # (n_gear,) Where they slip; 0 where there are none [rad]

    def spring(self, bend: FloatArray) -> FloatArray:
        """Returns the spring's torque (..., n_gear) [N m] at a deflection (..., n_gear) [rad]."""
        stretched = bend - np.clip(bend, -self._dead_band, self._dead_band)
        linear = self._linear * (1 + self._one_sided * np.sign(stretched))
        return np.asarray((linear + self._cubic * stretched**2) * stretched)

    def damper(self, bend: FloatArray) -> FloatArray:
        """Returns the damper's coefficient (..., n_gear) [N m s/rad]."""
        return self._damping * (1 + self._growth * np.abs(bend))


class GearErrors:
    """Applies what transmission errors add before the steps of a sample.

    Their torques are kept over the sample at their values in its middle, where the speed carries the robot.
    """

    def __init__(self, model: ElasticModel, batch: Batch, flaws: Imperfections, period_s: float) -> None:
        self._error = gear_error(model.robot, flaws)
        self.any = self._error is not None
        if self._error is None:
            return
        rows, joints = self._error.springs, self._error.joints
        transmissions = [row for row, spring in enumerate(model.robot.springs) if spring.place == "transmission"]
        self.gears = np.array([transmissions.index(row) for row in rows.tolist()])  # (n_gear,) Among the transmissions
        self.ahead: FloatArray = np.zeros((batch.nsim, rows.size))  # In the middle of the coming sample [rad]
        self._law, self._period_s = _Gears(model, rows, flaws), period_s
        self._motor, self._turns = model.motor[joints], model.turns[joints]
        self._rows = model.deflection[rows]
        self._columns = np.ascontiguousarray(self._rows.T)
        self._qpos, self._qvel, self._load, self._act = batch.qpos, batch.qvel, batch.qfrc_applied, batch.act
        self._rubs = flaws.hysteresis_nm > 0
        names = [model.robot.joints[joint].name for joint in joints]
        engine = model.mujoco
        self._bristles = [
            int(engine.actuator_actadr[engine.actuator(f"hysteresis_{name}").id]) for name in names if self._rubs
        ]
        self.begin()

    def begin(self) -> None:
        """Begins where the batch is: bristles take what they are bent by from here on."""
        self._begun = False

    def follow(self) -> None:
        """Adds what acts in the middle of the coming sample."""
        if self._error is None:
            return
        middle = self._qpos + 0.5 * self._period_s * self._qvel
        error, slope = self._error.at(middle[:, self._motor] * self._turns)
        bend, rate = middle @ self._columns, self._qvel @ self._columns
        extra = slope * self._qvel[:, self._motor] * self._turns
        bent, damper = self._law.spring(bend + error), self._law.damper(bend + error)
        lacking = bent - self._law.spring(bend) + damper * extra
        whole = bent + damper * (rate + extra)
        if self._rubs:
            whole += self._bristle_torque(error, self._period_s * rate)
        self._load -= lacking @ self._rows
        self._load[:, self._motor] -= whole * slope * self._turns
        self.ahead, self._begun = error, True

    def _bristle_torque(self, error: FloatArray, moved: FloatArray) -> FloatArray:
        """Bends the bristles by what the error has changed (n_sim, n_gear); returns their torques [N m].

        The engine bends them by the deflection's motion alone: `dz = w - |w| z / z_slip` for `w` the motion of the
        deflection in the coming sample, not of what the gear sees.
        """
        bristle = self._act[:, self._bristles]
        if self._begun:
            turned = error - self.ahead
            bristle += turned + (np.abs(moved) - np.abs(moved + turned)) * bristle / self._law.slip
            self._act[:, self._bristles] = bristle
        return np.asarray(self._law.bristles * bristle)


def refuse_fast_errors(robot: Robot, flaws: Imperfections, period_s: float, peak_speed: FloatArray) -> None:
    """Refuses errors that turn so far in a sample that their torques cannot be kept over it.

    Args:
        robot: The robot.
        flaws: Which errors its gears have.
        period_s: Sampling period [s].
        peak_speed (n_joint,): Highest speed that each motor is told [rad/s].

    Raises:
        DataError: If they do, naming the joint.
    """
    error = gear_error(robot, flaws)
    if error is None:
        return
    turn = error.order.max() * peak_speed[error.joints] * period_s
    worst = int(turn.argmax())
    if turn[worst] > _MOST_TURN:
        raise DataError(
            f"D650 the transmission error of `{robot.joints[error.joints[worst]].name}` changes too fast for the"
            " controller's samples",
            where=f"{error.order.max():g} periods per motor turn at {peak_speed[error.joints[worst]]:.3g} rad/s",
            remedy=f"at most {_MOST_TURN:g} rad of a period may pass in {period_s:g} s: lower `gear_error_order` or the"
            " number of harmonics, move slower, or shorten the sampling period",
        )


def with_gear_error(rest: Equilibrium, model: ElasticModel, flaws: Imperfections) -> Equilibrium:
    """Returns where a robot rests whose gears have errors: each arm turned by its gear's, which bends no spring."""
    error = gear_error(model.robot, flaws)
    if error is None:
        return rest
    angle = rest.position[:, model.motor[error.joints]] * model.turns[error.joints]
    turned, slope = error.at(angle)
    position, torque = rest.position.copy(), rest.motor_torque.copy()
    position[:, model.arm[error.joints]] += turned
    load = _Gears(model, error.springs, flaws).spring(rest.deflection[:, error.springs])
    torque[:, error.joints] += slope * load
    return replace(rest, position=position, motor_torque=torque)

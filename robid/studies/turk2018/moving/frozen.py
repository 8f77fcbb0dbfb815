"""The true drive, linearised wherever its slide is: what a linear model of it can reach at most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.spectra import line_amplitudes
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.robot.statespace import discretise, state_space
from robid.simulate.truth import TrueRobot, recorded_torque_factor, with_imperfections
from robid.studies.turk2018.moving.prediction import LEAD, led_in

_POINTS = 401
_RESTING = 1e-9  # rad, or m


@dataclass(frozen=True)
class FrozenDrive:
    """Sampled models on a grid of positions, all in the same states: angle, deflections, their rates, torques waiting.

    Attributes:
        position (n_point,): The grid, evenly spaced [rad, or m].
        A (n_point, n_state, n_state): System matrices.
        B (n_point, n_state): Input vectors, of the torque as it was recorded.
        C (n_point, n_out, n_state): Output matrices, of angles and positions.
        sampling_period_s: Sampling period.
    """

    position: FloatArray
    A: FloatArray
    B: FloatArray
    C: FloatArray
    sampling_period_s: float


def freeze_drive(
    truth: TrueRobot, outputs: tuple[str, ...], lower: float, upper: float, sampling_period_s: float
) -> FrozenDrive:
    """Linearises a simulated drive of one joint at positions all over a range.

    Args:
        truth: The robot that was simulated; of its friction only the viscous part counts.
        outputs: Names of the outputs, as of `robid.robot.linearize.linearize`.
        lower: Lower end of the range [rad, or m].
        upper: Upper end.
        sampling_period_s: Period of the held torque and of the outputs.

    Raises:
        DataError: If the drive has several joints, or rests under load: what it rests at would move with it.
    """
    robot = with_imperfections(truth.robot, truth.imperfections)
    motors = tuple(joint.name for joint in robot.joints)
    model, grid = build_model(robot), np.linspace(lower, upper, _POINTS)
    rest = solve_statics(model, grid[:, None]) if len(motors) == 1 else None
    if rest is None or np.abs(rest.deflection).max(initial=0.0) > _RESTING:
        message = "a moving drive is frozen only with a single joint that rests without load"
        raise DataError(message, where="campaign of the travelling slide", remedy="leave `global` out of the study")
    linear = linearize(model, rest, outputs)
    parameters, springs = nominal_parameters(robot, linear, truth.delay_s), tuple(s.name for s in robot.springs)
    sampled = [
        discretise(
            state_space(linear, parameters, index, motors, springs, outputs), sampling_period_s, truth.delay_s
        )
        for index in range(_POINTS)
    ]  # fmt: skip
    factor = float(recorded_torque_factor(robot, truth.truth)[0])
    return FrozenDrive(
        position=grid,
        A=np.array([one.A for one in sampled]),
        B=np.array([one.B[:, 0] for one in sampled]) / factor,
        C=np.array([one.C[: len(outputs)] for one in sampled]),
        sampling_period_s=sampling_period_s,
    )


def run_drive(drive: FrozenDrive, torque: FloatArray, position: FloatArray) -> FloatArray:
    """Runs a drive from rest, its matrices interpolated between the two nearest points of the grid.

    Args:
        drive: The drive.
        torque (n_sample,): Recorded torque [N m].
        position (n_sample,): Where it is, within the grid [rad, or m].

    Returns:
        Angles and positions (n_sample, n_out), from where they were at first.
    """
    place = np.clip((position - drive.position[0]) / (drive.position[1] - drive.position[0]), 0, _POINTS - 1)
    below = np.minimum(place.astype(int), _POINTS - 2)
    state = np.zeros(drive.A.shape[-1])
    outputs = np.empty((len(torque), drive.C.shape[1]))
    for sample, (row, share, pushed) in enumerate(
        zip(below.tolist(), (place - below).tolist(), torque.tolist(), strict=True)
    ):
        A, B, C = (one[row] + share * (one[row + 1] - one[row]) for one in (drive.A, drive.B, drive.C))
        outputs[sample] = C @ state
        state = A @ state + pushed * B
    return outputs


def drive_amplitudes(drive: FrozenDrive, torque: FloatArray, position: FloatArray, lines: IntArray) -> ComplexArray:
    """Runs a drive along measured torques and positions.

    What drives it off, as friction that is none of it, is differenced away: two differences of the outputs are
    stationary, and are undone at the lines.

    Args:
        drive: The drive.
        torque (n_period, n_sample): Recorded torque of successive periods of the steady state [N m].
        position (n_period, n_sample): Where it is [rad, or m].
        lines (n_freq,): DFT lines of one period, above zero.

    Returns:
        Amplitudes of the outputs (n_period, n_freq, n_out), DFT sums over the number of samples.
    """
    n_period, n_sample = torque.shape
    outputs = run_drive(drive, led_in(torque[..., None])[:, 0], led_in(position[..., None])[:, 0])
    twice = np.diff(outputs, n=2, axis=0)[LEAD * n_sample - 2 :].reshape(n_period, n_sample, -1)
    back = 1 - np.exp(-2j * np.pi * lines / n_sample)
    return np.asarray(line_amplitudes(twice, lines) / back[:, None] ** 2)

"""Models along a record in which the slide travels: the fitted one, and the true drive, linearised everywhere.

The drive is what a linear model can reach at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.errors import DataError
from robid.frf.spectra import line_amplitudes
from robid.models.lpv.fit.model import LpvModel, simulate_lpv, unit_circle
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.robot.statespace import discretise, state_space
from robid.simulate.truth import TrueRobot, recorded_torque_factor, with_imperfections

_POINTS = 401
_RESTING = 1e-9  # rad, or m


@dataclass(frozen=True)
class FrozenDrive:
    """Sampled models on a grid of positions, in the same states: angle, deflections, their rates, torques waiting."""

    position: FloatArray  # (n_point,) the grid, evenly spaced [rad, or m]
    A: FloatArray  # (n_point, n_state, n_state) system matrices
    B: FloatArray  # (n_point, n_state) input vectors, of the torque as it was recorded
    C: FloatArray  # (n_point, n_out, n_state) output matrices, of angles and positions
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
        message = "D223 a moving drive is frozen only with a single joint that rests without load"
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


LEAD = 2
"""Periods in which transients pass before the first one that counts."""


@dataclass(frozen=True)
class ErrorParts:
    """Amplitudes of a model's error at the lines of successive periods."""

    total: FloatArray  # (n_freq, n_out) root mean square over the periods
    systematic: FloatArray  # (n_freq, n_out) of the mean over the periods: what repeats
    stochastic: FloatArray  # (n_freq, n_out) root mean square over the periods of what is left

    @property
    def over_stochastic(self) -> FloatArray:
        """Deviation of the error over that of its stochastic part (n_out,).

        Of P periods and an error that is all noise this is `sqrt(P / (P - 1))`.

        Source:
            Turk et al. (2018), sec. III-C3.
        """
        return np.asarray(deviation(self.total) / deviation(self.stochastic))


def split_errors(error: ComplexArray) -> ErrorParts:
    """Splits errors (n_period, n_freq, n_out) into what repeats and the rest.

    Source:
        Turk et al. (2018), sec. III-C3.
    """
    mean = error.mean(axis=0)
    return ErrorParts(_over_periods(error), np.abs(mean), _over_periods(error - mean))


def error_excess(parts: ErrorParts, reference: ErrorParts) -> FloatArray:
    """Returns by how much errors exceed those of a reference model (n_out,), as a share of these."""
    return np.asarray(deviation(parts.total) / deviation(reference.total) - 1)


def measured_amplitudes(samples: FloatArray, lines: IntArray) -> ComplexArray:
    """Returns amplitudes at the lines of each period, whose drift is removed.

    Args:
        samples (n_period, n_sample, n_channel): Successive periods.
        lines (n_freq,): DFT lines of one period.

    Returns:
        DFT sums over the number of samples (n_period, n_freq, n_channel).
    """
    n_period, n_sample = samples.shape[:2]
    if n_period > 1:
        rise = np.gradient(samples.mean(axis=1), axis=0)
        samples = samples - rise[:, None] * ((np.arange(n_sample) + 0.5) / n_sample - 0.5)[:, None]
    return line_amplitudes(samples, lines)


def simulated_amplitudes(
    model: LpvModel, integrators: tuple[int, ...], inputs: FloatArray, scheduling: FloatArray, lines: IntArray
) -> ComplexArray:
    """Runs a model along measured inputs and scheduling parameters.

    Its transient passes in `LEAD` periods before the others, the same as the first of them. Integrators, behind
    which any offset of the inputs drifts away, are put back at the lines.

    Args:
        model: A stable model without its integrators.
        integrators: How often each output integrates.
        inputs (n_period, n_sample, n_in): Successive periods of the steady state.
        scheduling (n_period, n_sample, n_scheduling): Scheduling parameters of the same samples.
        lines (n_freq,): DFT lines of one period, above zero.

    Returns:
        Amplitudes of the outputs, as of `measured_amplitudes` (n_period, n_freq, n_out).

    Raises:
        DataError: If the parameters leave the model's range.
        ValueError: If the shapes do not agree.
    """
    n_period, n_sample = inputs.shape[:2]
    check_shape("scheduling", scheduling, "n_period n_sample n_scheduling", n_period=n_period, n_sample=n_sample)
    outputs, _ = simulate_lpv(model, led_in(inputs), led_in(scheduling))
    own = line_amplitudes(outputs[LEAD * n_sample :].reshape(n_period, n_sample, -1), lines)
    z = unit_circle(lines / (n_sample * model.sampling_period_s), model.sampling_period_s)
    return np.asarray(own / ((z[:, None] - 1) / model.sampling_period_s) ** np.array(integrators))


def deviation(amplitudes: FloatArray) -> FloatArray:
    """Returns the root mean square (n_out,) over the lines of amplitudes (n_freq, n_out)."""
    return np.asarray(np.sqrt(np.mean(amplitudes**2, axis=0)))


def led_in(samples: FloatArray) -> FloatArray:
    """Returns periods (n_period, n_sample, n_channel) in a row, the first of them `LEAD` times more."""
    return np.concatenate([*[samples[0]] * LEAD, samples.reshape(-1, samples.shape[-1])])


def _over_periods(values: ComplexArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(np.abs(values) ** 2, axis=0)))

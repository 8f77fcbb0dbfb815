"""The nominal closed loop, what noise leaves of a response in it, and amplitudes that are shaped by sensitivity."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.design.configurations.candidates import KINDS, natural_scales
from robid.frf.covariance import pool
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.controller import frequency_response
from robid.simulate.options import Controller

_SMALLEST_RATIO = 1e-12  # What an element that is exactly zero gets instead of a logarithm of zero


def residual_covariance(
    response: ComplexArray, omega: FloatArray, angle_noise_rad: float, torque_noise_nm: float
) -> ComplexArray:
    """Covariance of `Y - G U` where encoders are noisy and a torque disturbance acts behind the recorded command.

    Both are white from sample to sample. The loop feeds them back into U and Y, but not into what G leaves of them.

    Args:
        response (n_freq, n_out, n_in): Sampled response [rad/(s^2 N m)].
        omega (n_freq,): Angular frequency [rad/s].
        angle_noise_rad: Standard deviation of the motor angle's noise [rad].
        torque_noise_nm: Standard deviation of the disturbance [N m].

    Returns:
        `w^4 s_q^2 I + s_u^2 G G^H` (n_freq, n_out, n_out); divided by samples times periods it is the covariance
        of the averaged DFT coefficients [rad^2/s^4].
    """
    # Angle noise is differentiated twice: w^4; a torque disturbance shows through G.
    encoder = (angle_noise_rad**2 * omega**4)[:, None, None] * np.eye(response.shape[-2])
    return np.asarray(encoder + torque_noise_nm**2 * response @ response.conj().swapaxes(-1, -2))


def predicted_snr_db(
    response: ComplexArray, torque: ComplexArray, residual: ComplexArray, n_sample: int, periods: int
) -> FloatArray:
    """Power (n_freq, n_out, n_in) of the response over the variance that noise will give it, at least -120 dB [dB].

    The variance has the form of the estimate's own: input factor times the covariance of the residual. Distortion by
    friction and other nonlinearities is not in it.

    Args:
        response (n_freq, n_motor, n_motor): Sampled response [rad/(s^2 N m)].
        torque (n_real, n_exp, n_freq, n_motor): Complex amplitudes of the torque, n_exp = n_motor [N m].
        residual (n_freq, n_motor, n_motor): Covariance of the residual per sample [rad^2/s^4].
        n_sample: Samples in a period.
        periods: Recorded periods.

    Source:
        docs/methods, sec. 4 (covariance).
    """
    # A DFT over the number of samples gives half of a cosine's amplitude.
    inverse = np.linalg.inv(torque.transpose(0, 2, 3, 1) / 2)
    # Diagonal of the input factor: mean over realizations of |U^-1|^2 over their number (docs/methods, sec. 4).
    factor = np.sum(np.abs(inverse) ** 2, axis=(0, 2)) / len(torque) ** 2
    noise = np.real(np.diagonal(residual, axis1=-2, axis2=-1)) / (n_sample * periods)
    variance = noise[:, :, None] * factor[:, None, :]
    return np.asarray(10 * np.log10(np.maximum(np.abs(response) ** 2 / variance, _SMALLEST_RATIO)))


@dataclass(frozen=True)
class NominalLoop:
    """The nominal robot under its controller, at the excited lines."""

    robot: Robot  # Names, limits, gear ratios and rotor inertias
    controller: Controller
    configurations: FloatArray  # (n_conf, n_joint) Arm-side joint angles [rad]
    frequency_hz: FloatArray  # (n_freq,) Excited frequencies [Hz]
    # (n_conf, n_freq, n_motor, n_motor) Sampled response from motor torque to motor acceleration, hold and computation
    # delay inside [rad/(s^2 N m)]
    response: ComplexArray
    static_torque: FloatArray  # (n_conf, n_motor) Motor torque that holds the arm [N m]
    delay_s: float = 0.0  # Delay from recorded to applied torque, hold excluded [s]
    linear: LinearModel | None = None  # The linearised robot, for derivatives of the response

    @property
    def omega(self) -> FloatArray:
        """Angular frequency (n_freq,) [rad/s]."""
        return np.asarray(2 * np.pi * self.frequency_hz)

    def gains(self, index: int, inject: str) -> tuple[ComplexArray, ComplexArray]:
        """From references, injected somewhere, to motor torque and to motor angle in one configuration.

        Returns:
            Two arrays (n_freq, n_motor, n_motor) [N m and rad per unit of the reference].
        """
        reference, angle = frequency_response(self.controller, self.robot.motor_inertia_kgm2, self.omega, inject)
        # U = C_r R - C_q Q with Q = -G U / w^2.
        # Motor angle per torque, from acceleration per torque.
        plant = -self.response[index] / self.omega[:, None, None] ** 2
        identity = np.eye(plant.shape[-1])
        torque = np.linalg.solve(identity + angle[:, :, None] * plant, reference[:, :, None] * identity)
        return torque, plant @ torque

    def at(self, frequency_hz: FloatArray) -> NominalLoop:
        """Returns the same loop at other frequencies (n_freq,) [Hz].

        Raises:
            ValueError: If the linearised robot is not there.
        """
        if self.linear is None:
            raise ValueError("The linearised robot is needed at other frequencies.")
        nominal = nominal_parameters(self.robot, self.linear, self.delay_s)
        sampled = response(self.linear, nominal, frequency_hz, self.controller.sampling_period_s).sampled
        return replace(self, frequency_hz=frequency_hz, response=sampled)

    def central(self) -> int:
        """Index of the configuration nearest the mean of all."""
        distance = np.linalg.norm(self.configurations - self.configurations.mean(axis=0), axis=1)
        return int(np.argmin(distance))


def nominal_loop(
    robot: Robot, controller: Controller, configurations: FloatArray, frequency_hz: FloatArray
) -> NominalLoop:
    """Linearises the nominal robot in each configuration (n_conf, n_joint) [rad] and closes the loop (n_freq,) [Hz]."""
    period_s, model = controller.sampling_period_s, build_model(robot, balanced=True)
    delay_s, rest = controller.delay_samples * period_s, solve_statics(model, configurations)
    linear = linearize(model, rest)
    sampled = response(linear, nominal_parameters(robot, linear, delay_s), frequency_hz, period_s).sampled
    torque = rest.motor_torque
    return NominalLoop(robot, controller, configurations, frequency_hz, sampled, torque, delay_s, linear)


FLOOR = 0.3  # Smallest amplitude of a line, relative to the flat spectrum of the same RMS
_SMOOTHED_LINES = 5
_RIDGE = 1e-9


def sensitivity_amplitude(
    amplitude: FloatArray, loop: NominalLoop, inject: str, angle_noise_rad: float, torque_noise_nm: float
) -> FloatArray:
    """Shapes the amplitudes (n_motor, n_lines) of each motor's lines by their information; the RMS stays.

    The information about the log-parameters is linear in the power of each line. One step of the multiplicative
    algorithm for D-optimality, from the flat spectrum and with all configurations together, gives a line power in
    proportion to the trace of its own information against the inverse of the total; viscous friction and delay are
    nuisance parameters. It is averaged over five neighbouring lines, and no amplitude falls below `FLOOR`.

    Args:
        amplitude (n_motor, n_lines): Flat amplitudes [as reference].
        loop: The nominal loop with its linearised robot.
        inject: Where the excitation enters.
        angle_noise_rad: Assumed noise of the motor angle per sample [rad].
        torque_noise_nm: Assumed torque disturbance per sample [N m].

    Source:
        Silvey, Titterington and Torsney (1978); Zimmermann et al. (2023), eq. 4.
    """
    power = np.moveaxis(amplitude**2, 0, 1)
    each = line_information(loop, inject, angle_noise_rad, torque_noise_nm)
    # Silvey, Titterington and Torsney: power times its own directional derivative is one step towards D-optimality.
    score = pool(_scores(power, each, 2 * len(loop.robot.springs)).astype(complex), _SMOOTHED_LINES).real
    wanted = power * score
    share = wanted / wanted.mean(axis=0)
    return np.asarray(np.sqrt((FLOOR**2 + (1 - FLOOR**2) * share) * power.mean(axis=0)).T)


def line_information(loop: NominalLoop, inject: str, angle_noise_rad: float, torque_noise_nm: float) -> FloatArray:
    """Information of each motor's lines about the log-parameters, up to a common factor.

    The arguments are those of `sensitivity_amplitude`.

    Returns:
        Matrices (n_freq, n_motor, n_param, n_param) per squared amplitude, summed over configurations; springs and
        dampers first, nuisance parameters after them.
    """
    if loop.linear is None:
        raise ValueError("The loop has no linearised robot.")
    total: FloatArray | float = 0.0
    for index in range(len(loop.response)):
        slopes = _log_jacobian(loop, loop.linear, index)
        torque, _ = loop.gains(index, inject)
        # A motor's line of unit reference moves all torques by the loop's gains: dY = dG U.
        moved = np.einsum("foip,fij->fjop", slopes, torque, optimize=True)
        noise = residual_covariance(loop.response[index], loop.omega, angle_noise_rad, torque_noise_nm)
        # Whitened by the residual's covariance: J^H C^-1 J.
        white = np.linalg.solve(np.linalg.cholesky(noise)[:, None], moved)
        total = total + np.real(white.conj().swapaxes(-1, -2) @ white)
    return np.asarray(total)


def _log_jacobian(loop: NominalLoop, linear: LinearModel, index: int) -> ComplexArray:
    """Derivative (n_freq, n_out, n_in, n_param) in one configuration."""
    by_place = ("mass", "gravity_stiffness", "link_inertia", "output", "tilt")
    part = replace(linear, **{name: getattr(linear, name)[[index]] for name in by_place})
    period_s = loop.controller.sampling_period_s
    nominal = nominal_parameters(loop.robot, part, loop.delay_s)
    result = response(part, nominal, loop.frequency_hz, period_s)
    return np.asarray(jacobian(part, nominal, result, KINDS)[0] * natural_scales(nominal, period_s, KINDS))


def _scores(power: FloatArray, each: FloatArray, count: int) -> FloatArray:
    """Gain (n_freq, n_motor) of the log-determinant about the first `count` parameters, per unit of power."""
    total = np.einsum("fm,fmpq->pq", power, each)
    diagonal = np.diag(total)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled, lines = total / np.outer(scale, scale), each / np.outer(scale, scale)

    def gain(kept: slice) -> FloatArray:
        matrix = scaled[kept, kept]
        inverse = np.linalg.inv(matrix + _RIDGE * np.eye(len(matrix)))
        return np.asarray(np.einsum("fmpq,qp->fm", lines[..., kept, kept], inverse))

    # log det of the wanted part is that of all less that of the nuisances: so is its slope.
    return np.maximum(gain(slice(None)) - gain(slice(count, None)), 0.0)

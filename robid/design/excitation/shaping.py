"""Amplitude spectra: power where the frequency response tells most about springs and dampers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.design.configurations.candidates import KINDS, log_slopes
from robid.design.excitation.loop import NominalLoop
from robid.design.excitation.snr import residual_covariance
from robid.frf.covariance import pool
from robid.robot.derivatives import jacobian
from robid.robot.linearize import LinearModel
from robid.robot.response import nominal_parameters, response

FLOOR = 0.3  # Smallest amplitude of a line, relative to the flat spectrum of the same RMS
_SMOOTHED_LINES = 5
_RIDGE = 1e-9


def sensitivity_amplitude(
    amplitude: FloatArray, loop: NominalLoop, inject: str, angle_noise_rad: float, torque_noise_nm: float
) -> FloatArray:
    """Shapes the amplitude of each motor's lines by the information they carry.

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

    Returns:
        Amplitudes (n_motor, n_lines) of the same RMS per motor.

    Source:
        Silvey, Titterington and Torsney (1978); Zimmermann et al. (2023), eq. 4.
    """
    power = np.moveaxis(amplitude**2, 0, 1)
    each = line_information(loop, inject, angle_noise_rad, torque_noise_nm)
    score = pool(_scores(power, each, 2 * len(loop.robot.springs)).astype(complex), _SMOOTHED_LINES).real
    wanted = power * score
    share = wanted / wanted.mean(axis=0)
    return np.asarray(np.sqrt((FLOOR**2 + (1 - FLOOR**2) * share) * power.mean(axis=0)).T)


def line_information(loop: NominalLoop, inject: str, angle_noise_rad: float, torque_noise_nm: float) -> FloatArray:
    """Information of each motor's lines about the log-parameters, up to a common factor.

    Args:
        loop: The nominal loop with its linearised robot.
        inject: Where the excitation enters.
        angle_noise_rad: Assumed noise of the motor angle per sample [rad].
        torque_noise_nm: Assumed torque disturbance per sample [N m].

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
        moved = np.einsum("foip,fij->fjop", slopes, torque, optimize=True)
        noise = residual_covariance(loop.response[index], loop.omega, angle_noise_rad, torque_noise_nm)
        white = np.linalg.solve(np.linalg.cholesky(noise)[:, None], moved)
        total = total + np.real(white.conj().swapaxes(-1, -2) @ white)
    return np.asarray(total)


def _log_jacobian(loop: NominalLoop, linear: LinearModel, index: int) -> ComplexArray:
    """Derivative (n_freq, n_out, n_in, n_param) in one configuration."""
    part = replace(
        linear,
        mass=linear.mass[[index]],
        gravity_stiffness=linear.gravity_stiffness[[index]],
        link_inertia=linear.link_inertia[[index]],
        output=linear.output[[index]],
        tilt=linear.tilt[[index]],
    )
    period_s = loop.controller.sampling_period_s
    nominal = nominal_parameters(loop.robot, part, loop.delay_s)
    result = response(part, nominal, loop.frequency_hz, period_s)
    return np.asarray(jacobian(part, nominal, result, KINDS)[0] * log_slopes(nominal, period_s))


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

    return np.maximum(gain(slice(None)) - gain(slice(count, None)), 0.0)

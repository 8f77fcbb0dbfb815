"""What noise will leave of a frequency response, predicted before anything is measured."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray

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
    encoder = (angle_noise_rad**2 * omega**4)[:, None, None] * np.eye(response.shape[-2])
    return np.asarray(encoder + torque_noise_nm**2 * response @ response.conj().swapaxes(-1, -2))


def predicted_snr_db(
    response: ComplexArray, torque: ComplexArray, residual: ComplexArray, n_sample: int, periods: int
) -> FloatArray:
    """Power of each element of the response over the variance that noise will give its estimate.

    The variance has the form of the estimate's own: input factor times the covariance of the residual. Distortion by
    friction and other nonlinearities is not in it.

    Args:
        response (n_freq, n_motor, n_motor): Sampled response [rad/(s^2 N m)].
        torque (n_real, n_exp, n_freq, n_motor): Complex amplitudes of the torque, n_exp = n_motor [N m].
        residual (n_freq, n_motor, n_motor): Covariance of the residual per sample [rad^2/s^4].
        n_sample: Samples in a period.
        periods: Recorded periods.

    Returns:
        Signal-to-noise ratio (n_freq, n_out, n_in), at least -120 dB [dB].

    Source:
        docs/methods, sec. 4 (covariance).
    """
    # A DFT over the number of samples gives half of a cosine's amplitude.
    inverse = np.linalg.inv(torque.transpose(0, 2, 3, 1) / 2)
    factor = np.sum(np.abs(inverse) ** 2, axis=(0, 2)) / len(torque) ** 2
    noise = np.real(np.diagonal(residual, axis1=-2, axis2=-1)) / (n_sample * periods)
    variance = noise[:, :, None] * factor[:, None, :]
    return np.asarray(10 * np.log10(np.maximum(np.abs(response) ** 2 / variance, _SMALLEST_RATIO)))

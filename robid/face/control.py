"""Frequency responses to python-control and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robid.errors import require_module
from robid.frf.frf import Frf
from robid.signals.quantities import motor_channels

if TYPE_CHECKING:
    from robid.arrays import FloatArray


def to_control(responses: Frf, configuration: int = 0) -> Any:  # noqa: ANN401
    """Returns the response of one configuration as `control.FrequencyResponseData`, without its covariance.

    A dot in a channel's name becomes an underscore.

    Args:
        responses: Frequency responses.
        configuration: Row of the configuration, from 0.

    Raises:
        SettingsError: If python-control is not installed.
    """
    require_module("control", "control", "A response of python-control")
    import control

    return control.FrequencyResponseData(
        responses.response[configuration].transpose(1, 2, 0),
        2 * np.pi * responses.frequency_hz,
        # python-control keeps dots for subsystems.
        inputs=[name.replace(".", "_") for name in responses.input_names],
        outputs=[name.replace(".", "_") for name in responses.output_names],
        smooth=len(responses.frequency_hz) > 3,
    )


def from_control(
    response: Any,  # noqa: ANN401
    sampling_period_s: float,
    *,
    configuration: FloatArray | None = None,
    relative_std: float = 0.01,
) -> Frf:
    """Returns a response of python-control from motor torques to motor accelerations, noise of a stated size beside it.

    Args:
        response: A `control.FrequencyResponseData`, rad/s^2 per N m over rad/s.
        sampling_period_s: Sampling period of the experiment behind it [s].
        configuration (1, n_joint): Arm-side joint positions [rad, or m]; zeros when not given.
        relative_std: Standard deviation of an element's noise over the median size of its output's responses.
    """
    values = np.asarray(response.frdata if hasattr(response, "frdata") else response.fresp).transpose(2, 0, 1)[None]
    frequency_hz = np.asarray(response.omega, float) / (2 * np.pi)
    (_, n_freq, n_out, n_in), names = values.shape, [str(name) for name in response.input_labels]
    level = relative_std * np.median(np.abs(values), axis=(0, 1, 3))
    covariance = np.broadcast_to(np.diag(level.astype(complex) ** 2), (1, n_freq, n_out, n_out))
    return Frf(
        frequency_hz=frequency_hz,
        lines=np.arange(1, n_freq + 1),
        configurations=np.zeros((1, n_in)) if configuration is None else np.atleast_2d(configuration),
        response=values,
        input_factor=np.broadcast_to(np.eye(n_in, dtype=complex), (1, n_freq, n_in, n_in)),
        element_scale=np.ones((1, n_out, n_in)),
        total_covariance=covariance,
        noise_covariance=covariance,
        total_degrees_of_freedom=_STATED,
        noise_degrees_of_freedom=_STATED,
        sensitivity=np.zeros((1, 0, n_freq, n_out, n_in), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((1, n_in)),
        sampling_period_s=sampling_period_s,
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels([str(name) for name in response.output_labels], "acceleration"),
    )


_STATED = 1e6  # degrees of freedom of a covariance that is stated

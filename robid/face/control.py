"""Frequency responses to python-control and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robid.errors import SettingsError, require_module
from robid.face.arguments import check_axes, kind_of, required, shaped, wrong_shape, wrong_type
from robid.frf.frf import NO_RECORD, Frf
from robid.signals.quantities import motor_channels

if TYPE_CHECKING:
    from robid.arrays import ComplexArray, FloatArray


def to_control(responses: Frf, configuration: int = 0) -> Any:  # noqa: ANN401
    """Returns the response of one configuration as `control.FrequencyResponseData`, without its covariance.

    A dot in a channel's name becomes an underscore. Where a line tells too little of an input the response from it is
    NaN, as `Frf.known_response` has it, and nothing interpolates between the lines.

    Args:
        responses: Frequency responses.
        configuration: Row of the configuration, from 0.

    Raises:
        SettingsError: If python-control is not installed, or an argument is something else.
    """
    require_module("control", "control", "A response of python-control")
    responses = required(responses, Frf, "responses", "to_control", "robid.estimate_frf(record)")
    check_axes(responses, "to_control")
    if not 0 <= configuration < len(responses.response):
        what = f"S578 `configuration` is {configuration}; there are {len(responses.response)}, counted from 0"
        raise SettingsError(what, where="to_control", remedy="name a row of `responses.configurations`")
    values = responses.known_response[configuration]
    import control

    return control.FrequencyResponseData(
        values.transpose(1, 2, 0),
        2 * np.pi * responses.frequency_hz,
        # python-control keeps dots for subsystems.
        inputs=[name.replace(".", "_") for name in responses.input_names],
        outputs=[name.replace(".", "_") for name in responses.output_names],
        # A spline through NaN is NaN everywhere.
        smooth=bool(len(responses.frequency_hz) > 3 and np.isfinite(values).all()),
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

    Raises:
        SettingsError: If it is no response, its array has other axes than (output, input, frequency), or a value of it
            is not finite.
    """
    values, frequency_hz = _of_control(response)
    (_, n_freq, n_out, n_in), names = values.shape, [str(name) for name in response.input_labels]
    level = relative_std * np.median(np.abs(values), axis=(0, 1, 3))
    covariance = np.broadcast_to(np.diag(level.astype(complex) ** 2), (1, n_freq, n_out, n_out))
    return Frf(
        frequency_hz=frequency_hz,
        lines=np.arange(1, n_freq + 1),
        configurations=np.zeros((1, n_in)) if configuration is None else _one(configuration),
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
        notes=(NO_RECORD,),
    )


def _of_control(response: Any) -> tuple[ComplexArray, FloatArray]:  # noqa: ANN401
    """Values (1, n_freq, n_out, n_in) and frequencies (n_freq,) [Hz] of a response of python-control."""
    values = response.frdata if hasattr(response, "frdata") else getattr(response, "fresp", None)
    if values is None or not all(hasattr(response, name) for name in ("omega", "output_labels", "input_labels")):
        what = f"`response` is {kind_of(response)}, but must be a control.FrequencyResponseData"
        raise wrong_type(what, "from_control", "give what `control.FrequencyResponseData` makes")
    found, omega = np.asarray(values, complex), np.asarray(response.omega, float)
    wanted = (len(response.output_labels), len(response.input_labels), len(omega))
    if found.shape != wanted:
        what = f"the response has shape {found.shape}, but its names and frequencies ask for {wanted}"
        raise wrong_shape(what, "from_control", "bring its axes into the order (output, input, frequency)")
    if not np.isfinite(found).all():
        what = "S579 the response has values that are not finite"
        raise SettingsError(what, where="from_control", remedy="leave out the frequencies that have them")
    return found.transpose(2, 0, 1)[None], omega / (2 * np.pi)


def _one(configuration: FloatArray) -> FloatArray:
    return shaped(np.atleast_2d(configuration), "configuration", "n_conf n_joint", "from_control", n_conf=1)


_STATED = 1e6  # degrees of freedom of a covariance that is stated

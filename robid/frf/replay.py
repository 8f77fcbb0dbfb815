"""One period of an experiment in time: what was measured at the excited lines, and what a model answers there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.frf.spectra import record_blocks
from robid.signals.record import Record

_ROUNDING = 1e-9  # of a response: what saving it may change


@dataclass(frozen=True)
class Replay:
    """One period of one experiment, mean over its periods, drift removed."""

    time_s: FloatArray  # (n_sample,): time in the period [s]
    measured: FloatArray  # (n_sample, n_out): outputs at the excited lines
    modelled: FloatArray  # (n_sample, n_out): the model's at the same lines, under the measured inputs
    whole: FloatArray  # (n_sample, n_out): outputs at all lines up to the highest excited one

    @property
    def relative_error(self) -> FloatArray:
        """Norm of the difference over that of what was measured (n_out,)."""
        size = np.linalg.norm(self.measured, axis=0)
        error = np.linalg.norm(self.measured - self.modelled, axis=0)
        return np.asarray(np.divide(error, size, out=np.full_like(error, np.nan), where=size > 0))


def replay(
    record: Record, frf: Frf, model: ComplexArray, configuration: int, realization: int = 0, experiment: int = 0
) -> Replay | None:
    """Replays one experiment: measured outputs, and the model's answer to the measured inputs.

    The loop is closed: the model is driven by the inputs that were measured, less the friction that was subtracted for
    the response, not by what was injected. At the lines its answer is `G U`, which an inverse DFT brings to time.

    Args:
        record: Record of the configuration alone.
        frf: Responses with the inputs of their experiments.
        model (n_freq, n_out, n_in): The model's response in that configuration, in the unit of `frf.response`.
        configuration: Index of the configuration in the response.
        realization: Index of the realization.
        experiment: Index of the experiment in its block.

    Returns:
        The signals; None where the record does not repeat, or the response kept no inputs of that experiment.
    """
    inputs = _inputs_of(frf, configuration, realization * record.inputs.shape[2] + experiment)
    if record.is_one_shot or inputs is None:
        return None
    lines = np.rint(frf.frequency_hz * record.period_s).astype(int)
    one = replace(
        record,
        inputs=record.inputs[:, realization : realization + 1, experiment : experiment + 1],
        outputs=record.outputs[:, realization : realization + 1, experiment : experiment + 1],
        reference=None,
    )
    accelerations = frf.output_channels != record.output_channels
    every = np.arange(1, int(lines.max()) + 1)
    spectrum = record_blocks(one, every, accelerations=accelerations).outputs[0, :, :, 0]
    n_sample = record.inputs.shape[4]
    answer = np.einsum("foi,fi->fo", model, inputs)
    return Replay(
        time_s=np.arange(n_sample) * record.sampling_period_s,
        measured=in_time(spectrum[lines - 1], lines, n_sample),
        modelled=in_time(answer, lines, n_sample),
        whole=in_time(spectrum, every, n_sample),
    )


def _inputs_of(frf: Frf, configuration: int, block: int) -> ComplexArray | None:
    """Amplitudes (n_freq, n_in) of the inputs in one experiment of all realizations, if they were kept."""
    if frf.input_amplitude is None or block >= frf.input_amplitude.shape[-1]:
        return None
    found = frf.input_amplitude[configuration, :, :, block]
    return found if np.isfinite(found).all() else None


def corrected_inputs(frf: Frf, response: ComplexArray) -> Frf:
    """Returns responses whose inputs are those of a response that a fit has corrected for the subtracted friction.

    A fit that corrects the friction moves the response from `G` to `G'` while the outputs `G U` stay: the inputs
    become `G'^+ G U`. With fewer outputs than inputs they are not determined, and stay.

    Args:
        frf: Responses as they were estimated.
        response (n_conf, n_freq, n_out, n_in): What the fit made of them.
    """
    n_out, n_in = response.shape[2:]
    same = np.allclose(response, frf.response, rtol=_ROUNDING, atol=_ROUNDING * np.abs(frf.response).max())
    if frf.input_amplitude is None or n_out < n_in or same:
        return replace(frf, response=response)
    moved = np.linalg.pinv(response) @ frf.response @ frf.input_amplitude
    return replace(frf, response=response, input_amplitude=moved)


def in_time(amplitude: ComplexArray, lines: IntArray, n_sample: int) -> FloatArray:
    """Signals (n_sample, n_channel) over one period from amplitudes (n_line, n_channel) at some of its DFT lines."""
    spectrum = np.zeros((n_sample // 2 + 1, amplitude.shape[1]), complex)
    spectrum[lines] = amplitude
    return np.asarray(irfft(spectrum, n_sample, axis=0, norm="forward"))

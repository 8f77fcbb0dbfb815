"""Holds a position-dependent model against a record in which its scheduling parameters move periodically."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.frf.spectra import line_amplitudes
from robid.models.lpv.fit.model import LpvModel, simulate_lpv, unit_circle

LEAD = 2
"""Periods in which transients pass before the first one that counts."""


@dataclass(frozen=True)
class ErrorParts:
    """Amplitudes of a model's error at the lines of successive periods.

    Attributes:
        total (n_freq, n_out): Root mean square over the periods.
        systematic (n_freq, n_out): Of the mean over the periods: what repeats.
        stochastic (n_freq, n_out): Root mean square over the periods of what is left.
    """

    total: FloatArray
    systematic: FloatArray
    stochastic: FloatArray

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

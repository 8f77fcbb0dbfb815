"""A measured frequency response with its variance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape

ResponseHold = Literal["zoh", "none"]


@dataclass(frozen=True)
class MeasuredResponse:
    """A frequency response as an analyser gives it: elements at lines, and how far each may be off."""

    frequency_hz: FloatArray  # (n_freq,) Lines [Hz], above zero
    response: ComplexArray  # (n_freq, n_out, n_in) Output over input
    # (n_freq, n_out, n_in): E|error|^2 of the complex element, half of it per real part; infinite where it is unknown
    variance: FloatArray
    sampling_period_s: float | None = None  # None of a response that was never sampled
    hold: ResponseHold = "none"  # whether the response contains a zero-order hold, which a continuous model does not

    def check(self) -> None:
        """Checks shapes and values.

        Raises:
            ValueError: If a shape does not fit, a line is not above zero or repeated, or a variance not above zero.
        """
        n_freq, n_out, n_in = self.response.shape if self.response.ndim == 3 else (0, 0, 0)
        check_shape("response", self.response, "n_freq n_out n_in")
        check_shape("frequency_hz", self.frequency_hz, "n_freq", n_freq=n_freq)
        check_shape("variance", self.variance, "n_freq n_out n_in", n_freq=n_freq, n_out=n_out, n_in=n_in)
        known = np.isfinite(self.variance)
        if n_freq == 0 or not np.isfinite(self.frequency_hz).all() or self.frequency_hz.min() <= 0:
            message = "Argument `frequency_hz` must have values above zero."
            raise ValueError(message)
        if np.unique(self.frequency_hz).size < n_freq:
            message = "Argument `frequency_hz` must have each line once."
            raise ValueError(message)
        if np.isnan(self.variance).any() or (self.variance <= 0).any() or not np.isfinite(self.response[known]).all():
            message = "Argument `variance` must be above zero, and infinite where the response is unknown."
            raise ValueError(message)
        if not known.any(axis=0).all():
            message = "Argument `response` must know each element at some line."
            raise ValueError(message)
        if self.hold == "zoh" and self.sampling_period_s is None:
            message = "Argument `sampling_period_s` must be given where the response contains a hold."
            raise ValueError(message)

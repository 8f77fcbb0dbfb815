"""Local frequency responses, and the problem that they pose."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.models.lpv.fit.basis import Basis
from robid.models.lpv.fit.model import unit_circle
from robid.models.lpv.fit.problem import Problem
from robid.models.lpv.fit.state_space import Sizes


@dataclass(frozen=True)
class LocalResponses:
    """Frequency responses at rest at some positions.

    Attributes:
        points (n_pos, n_scheduling): Scheduling parameters.
        frequency_hz (n_freq,): Lines, above zero and below half the sampling rate.
        response (n_pos, n_freq, n_out, n_in): Responses.
        variance (n_pos, n_freq, n_out, n_in): `E|G_hat - G|^2`, infinite for an element that is to be left out; None
            where it is unknown.
        sampling_period_s: Sampling period.
    """

    points: FloatArray
    frequency_hz: FloatArray
    response: ComplexArray
    variance: FloatArray | None
    sampling_period_s: float

    def __post_init__(self) -> None:
        check_shape("response", self.response, "n_pos n_freq n_out n_in", n_freq=len(self.frequency_hz))
        check_shape("points", self.points, "n_pos n_scheduling", n_pos=len(self.response))
        if self.variance is not None and self.variance.shape != self.response.shape:
            raise ValueError("Argument `variance` must have the shape of `response`.")
        if not np.all(np.isfinite(self.response)):
            raise ValueError("Argument `response` must be finite; an infinite variance leaves an element out.")
        if not np.all((self.frequency_hz > 0) & (2 * self.frequency_hz * self.sampling_period_s < 1)):
            raise ValueError("Argument `frequency_hz` must lie between zero and half the sampling rate.")

    @property
    def z(self) -> ComplexArray:
        """The lines' points on the unit circle (n_freq,)."""
        return unit_circle(self.frequency_hz, self.sampling_period_s)


def remove_integrators(responses: LocalResponses, integrators: tuple[int, ...]) -> LocalResponses:
    """Multiplies each output's response by `(z - 1) / T` as often as it integrates.

    Source:
        Turk et al. (2018), sec. III-B.
    """
    if len(integrators) != responses.response.shape[2]:
        raise ValueError("Argument `integrators` must have one count per output.")
    factor = ((responses.z[:, None] - 1) / responses.sampling_period_s) ** np.array(integrators)
    variance = None if responses.variance is None else responses.variance * np.abs(factor[..., None]) ** 2
    return replace(responses, response=responses.response * factor[..., None], variance=variance)


def output_scales(responses: LocalResponses) -> FloatArray:
    """Returns the rms (n_out,) of each output's response: in such units, norms of blocks weigh outputs alike."""
    power = np.mean(np.abs(responses.response) ** 2, axis=(0, 1, 3))
    return np.where(power > 0, np.sqrt(power), 1.0)


def smooth_variance(variance: FloatArray, window: int) -> FloatArray:
    """Averages variances over neighbouring lines, infinite ones left out and left as they are.

    Variances from a few realizations scatter widely, and so would weights: with three degrees of freedom, estimates
    scatter by 1.4 times the least.

    Args:
        variance (n_pos, n_freq, n_out, n_in): Variances.
        window: Lines that are averaged, fewer at the ends.
    """
    known = np.isfinite(variance)
    sums = [
        np.cumsum(np.pad(values, ((0, 0), (1, 0), (0, 0), (0, 0))), axis=1)
        for values in (np.where(known, variance, 0.0), known.astype(float))
    ]
    lines = np.arange(variance.shape[1])
    low, high = np.maximum(lines - window // 2, 0), np.minimum(lines + window // 2 + 1, len(lines))
    total, count = (values[:, high] - values[:, low] for values in sums)
    return np.where(known, total / np.maximum(count, 1.0), np.inf)


def make_problem(
    responses: LocalResponses, basis: Basis, n_state: int, scales: FloatArray, *, weighted: bool, window: int = 1
) -> Problem:
    """Poses the fit of responses in units of the outputs' scales; the cost is that of the outputs' own units.

    Args:
        responses: Responses without integrators.
        basis: The basis functions.
        n_state: Number of states.
        scales (n_out,): Units of the outputs.
        weighted: Whether elements are weighted by `1 / sigma^2`, or all alike as in the paper (eq. 7).
        window: Lines over which variances are averaged for the weights.

    Raises:
        DataError: If a position lies outside the basis' range.
        ValueError: If weights are asked for and the variance is unknown or not positive.
    """
    column = scales[:, None]
    root_weight = np.broadcast_to(column, responses.response.shape)
    if weighted:
        if responses.variance is None or not np.all(responses.variance > 0):
            raise ValueError("Weights need a positive variance of every element.")
        root_weight = column / np.sqrt(smooth_variance(responses.variance, window))
    elif responses.variance is not None:
        root_weight = np.where(np.isinf(responses.variance), 0.0, root_weight)
    n_out, n_in = responses.response.shape[2:]
    values = basis.values(responses.points)
    return Problem(responses.z, responses.response / column, root_weight, values, Sizes(n_state, n_in, n_out))

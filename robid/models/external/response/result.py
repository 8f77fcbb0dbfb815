"""What a fit to a response found: transfer functions with common poles and a delay, and how far they may be off."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.parameters import Root
from robid.models.external.response.lines import Lines
from robid.models.external.response.options import Time
from robid.models.external.response.uncertainty import Spread, response_of


@dataclass(frozen=True)
class Tried:
    """A structure that was tried."""

    poles: int  # integrators included
    zeros: tuple[int, ...]  # of each element, inputs fastest
    integrators: int
    delay_s: float
    delay_estimated: bool
    cost: float
    score: float  # cost over `scale`, plus the price of the parameters: the lowest has the most evidence


@dataclass(frozen=True)
class ResponseAt:
    """A fitted response and its standard deviation."""

    response: ComplexArray  # (n_freq, n_out, n_in)
    real_std: FloatArray  # (n_freq, n_out, n_in) of the real part
    imaginary_std: FloatArray  # (n_freq, n_out, n_in) of the imaginary part


@dataclass(frozen=True)
class RationalFit:
    """Rational transfer functions `B_oi / A exp(-s T)` over one denominator, or in z with a delay in samples."""

    time: Time
    numerator: FloatArray  # (n_out, n_in, n_power) highest power of s [rad/s] or z first
    denominator: FloatArray  # (n_pole + 1,) highest power first, which has coefficient 1
    delay_s: float
    delay_std_s: float  # zero where it was not estimated
    sampling_period_s: float | None
    integrators: int  # exact poles at s = 0 or z = 1
    poles: tuple[Root, ...]  # all other poles, slow ones first [rad/s] or in z; of a pair both
    zeros: tuple[tuple[tuple[Root, ...], ...], ...]  # (n_out)(n_in) zeros of each element; those fixed at z = 0 apart
    gain: FloatArray  # (n_out, n_in) limit of `s^integrators G(s)` at zero frequency [1/s^integrators]
    gain_std: FloatArray  # (n_out, n_in)
    # (n_param, n_root): a root of the covariance of `[numerator, denominator without its first, delay_s]`, powers in
    # the order above and over those of `reference`
    covariance_root: FloatArray
    reference: float  # [rad/s], or 1 in discrete time: coefficients of s^k are scaled by its k-th power in the root
    cost: float  # sum of squares of all real and imaginary parts over their deviations
    degrees_of_freedom: int  # data less parameters: what the cost is expected to be
    misfit_chance: float  # of a cost as high, were model and variance right
    widened: float  # factor on all deviations: above one where the cost is significantly above its expectation
    confidence: float  # level of the intervals
    tried: tuple[Tried, ...]  # structures, best score first
    lines: Lines = field(repr=False)  # what was fitted
    spread: Spread = field(repr=False)  # the model in its own basis, which keeps the digits that powers of s lose
    # other structures that the data do not exclude, each with its weight; what is left to one is the model's own
    alternatives: tuple[tuple[float, Spread], ...] = field(default=(), repr=False)
    # zeros that the response asks for beyond what was allowed: poles beyond all lines stand for them
    missing_zeros: int = 0

    @property
    def n_pole(self) -> int:
        """Number of poles, integrators included."""
        return len(self.denominator) - 1

    @property
    def quantile(self) -> float:
        """Standard deviations on either side that an interval spans."""
        return float(norm.ppf(0.5 + self.confidence / 2))

    @property
    def is_stable(self) -> bool:
        """Whether all poles but the integrators are stable."""
        places = np.array([root.place for root in self.poles])
        return bool((np.abs(places) < 1).all() if self.time == "discrete" else (places.real < 0).all())

    def interval(self, root: Root) -> tuple[complex, complex]:
        """Returns the lower and upper ends of the intervals of a root's real and imaginary part."""
        half = self.quantile * complex(np.linalg.norm(root.moves.real), np.linalg.norm(root.moves.imag))
        return root.place - half, root.place + half

    def response_at(self, frequency_hz: FloatArray) -> ResponseAt:
        """Computes the response without the hold of the data, and its standard deviation, at frequencies [Hz].

        The deviation contains the choice of the structure: zeros, poles or a delay for which there was no evidence may
        be there all the same. It is the mean over structures, weighted by their evidence, of variance and squared
        distance.

        Source:
            Buckland, Burnham and Augustin (1997), "Model selection: an integral part of inference".
        """
        omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
        turn = omega * self.lines.delay_unit_s
        x = np.tan(turn / 2) if self.time == "discrete" else omega / self.lines.reference
        found, *deviations = response_of(self.lines, self.spread, x, turn)
        own = 1 - sum(weight for weight, _ in self.alternatives)
        squares = own * np.array(deviations) ** 2
        for weight, spread in self.alternatives:
            other, *further = response_of(self.lines, spread, x, turn)
            distance = other - found
            squares = squares + weight * (np.array(further) ** 2 + np.array([distance.real, distance.imag]) ** 2)
        shape = (len(omega), *self.numerator.shape[:2])
        real, imaginary = (np.sqrt(part).T.reshape(shape) for part in squares)
        return ResponseAt(found.T.reshape(shape), real, imaginary)

"""What holding torques and sampling outputs do to a continuous response: hold, delay, what folds down from above."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.signals.quantities import Rate

_POSITION: tuple[Rate, ...] = (0,)
_ALIASES = (-2, -1, 1, 2)
_IMAGES = (-3, -2, -1, 1, 2, 3)
_SIMPLE_SHARE = 0.15  # of the sampling rate, up to which images of positions hardly count
_LAST = 4 * np.exp(1j * np.deg2rad(75))  # over the sampling rate; so far from the imaginary axis nothing rings
_SAME_INSTANT = 1e-9  # of a period


@dataclass(frozen=True)
class Folding:
    """What the continuous response above half the sampling rate adds to the sampled one, a linear map of it.

    A held torque has every frequency `w_k = w + 2 pi k / T`, and an output that is sampled shows them all at `w`. Of an
    output that was differentiated r times before it was sampled, and that stands for its acceleration `A`,

        `sum over k != 0 of (w / w_k)^(2 - r) hold(w_k) exp(-j w_k T_d) A(w_k)`

    folds down. Images of positions fall with the cube of frequency: the limit of `A` at infinite frequency will do, two
    images on each side, up to some share of the sampling rate. Those of speeds fall with the square and those of
    accelerations with frequency itself. Of these, and of positions above that share, the first three images on each
    side are taken from the response itself, and all further ones, in closed form, from
    `A = F_0 + F_1 / s + F_2 / s^2`, of which F_0 is the limit and the others are seen at one complex frequency s.
    """

    fast: ComplexArray  # (n_freq, n_out) Factor of the limit
    # (n_image,) Angular frequencies at which the continuous response is needed, the images of every line, then the
    # complex one, `s / j`; none where the limit will do for all outputs [rad/s]
    omega: ComplexArray
    mirrored: BoolArray  # (n_image,) Which of them stand for their negatives, where the response is conjugate
    weight: ComplexArray  # (6, n_freq, n_out) Factors of the images
    tail: ComplexArray  # (2, n_freq, n_out) Factors of real and imaginary part at the last one

    def images(self, values: ComplexArray) -> ComplexArray:
        """Returns what folds down without the limit (n_conf, n_freq, n_out, ...).

        Args:
            values (n_conf, n_image, n_out, ...): The continuous response at `omega`, or real-valued parameters'
                derivatives of it.
        """
        signed, last = self.signed(values, 1)
        trailing = (1,) * (values.ndim - 3)
        weight = self.weight.reshape(*self.weight.shape, *trailing)
        tail = self.tail.reshape(*self.tail.shape, *trailing)
        found = np.einsum("kfo...,ckfo...->cfo...", weight, signed)
        return np.asarray(found + tail[0] * last.real + tail[1] * last.imag)

    def signed(self, values: ComplexArray, axis: int) -> tuple[ComplexArray, ComplexArray]:
        """Splits an axis of images into (6, n_freq), conjugate where they are mirrored, and the last one (1,)."""
        shape = values.shape
        turned = np.moveaxis(values, axis, -1)
        turned = np.where(self.mirrored, turned.conj(), turned)
        turned = np.moveaxis(turned, -1, axis)
        count = self.weight.shape[1]
        last = np.take(turned, [-1], axis=axis)
        first = np.take(turned, range(shape[axis] - 1), axis=axis)
        return first.reshape(*shape[:axis], len(_IMAGES), count, *shape[axis + 1 :]), last


def hold_factor(omega: FloatArray, delay_s: float, sampling_period_s: float | None) -> ComplexArray:
    """Returns what hold and delay multiply the continuous response by (n_freq,)."""
    lag = np.exp(-1j * omega * delay_s)
    if sampling_period_s is None:
        return np.asarray(lag)
    # zoh = sinc(w T / 2 pi) exp(-j w T / 2), times the delay.
    half = 0.5 * omega * sampling_period_s
    return np.asarray(np.sinc(half / np.pi) * np.exp(-1j * half) * lag)


def _alias_factor(omega: FloatArray, delay_s: float, sampling_period_s: float) -> tuple[ComplexArray, ComplexArray]:
    """What the fast limit is multiplied by as it folds down (n_freq,), and its derivative by the delay."""
    total = np.zeros(omega.size, complex)
    slope = np.zeros(omega.size, complex)
    for shift in _ALIASES:
        # Two aliases on each side: what images of positions add falls with the cube of frequency.
        alias = omega + shift * 2 * np.pi / sampling_period_s
        term = (omega / alias) ** 2 * hold_factor(alias, delay_s, sampling_period_s)
        total += term
        slope += -1j * alias * term
    return total, slope


def make_folding(
    omega: FloatArray, delay_s: float, sampling_period_s: float, rates: tuple[Rate, ...], n_out: int
) -> tuple[Folding, Folding]:
    """Sets up what folds down onto outputs, and its derivative by the delay.

    Args:
        omega (n_freq,): Angular frequencies below half the sampling rate [rad/s].
        delay_s: Delay from the recorded torque to its effect, hold excluded [s].
        sampling_period_s: Period of the held torque and of the samples [s].
        rates (n_out,): How many times each output was differentiated before it was sampled; None for one that is
            filtered so that nothing folds down. Empty for positions in the simple form at all frequencies.
        n_out: Number of outputs.

    Returns:
        Both maps. Accelerations that follow a torque at once are sampled before it changes.

    Source:
        Poisson's sum formula; docs/methods, sec. 1 (Sampling) for positions.
    """
    share = omega * sampling_period_s / (2 * np.pi)
    # Below this share of the sampling rate the fast limit stands well enough for images of positions.
    high = (share > _SIMPLE_SHARE) & (share < 0.5) & bool(rates)
    rates = rates or _POSITION * n_out
    images = any(rates) or (0 in rates and bool(high.any()))
    pair = [_nothing(omega, sampling_period_s, len(rates), images=images) for _ in range(2)]
    for rate in sorted({each for each in rates if each is not None}):
        columns = [column for column, each in enumerate(rates) if each == rate]
        if rate or images:
            chosen = np.ones_like(high) if rate else high
            for one, terms in zip(pair, _terms(omega, delay_s, sampling_period_s, rate), strict=True):
                for target, factor in zip((one.fast, one.weight, one.tail), terms, strict=True):
                    target[..., columns] = np.where(chosen, factor, 0)[..., None]
        if rate == 0:
            for one, factor in zip(pair, _alias_factor(omega, delay_s, sampling_period_s), strict=True):
                one.fast[:, columns] = np.where(high[:, None], one.fast[:, columns], factor[:, None])
    return pair[0], pair[1]


def _nothing(omega: FloatArray, period_s: float, n_out: int, *, images: bool) -> Folding:
    """A map to zero with the places of its images, if there are any."""
    places = np.zeros(0, complex)
    if images:
        places = np.append(_images(omega, period_s).ravel(), _last(period_s) / 1j)
    n_freq = omega.size
    # Responses of real systems are conjugate at negative frequencies, so that positive ones will do.
    mirrored = (places.real < 0) & (places.imag == 0)
    return Folding(
        fast=np.zeros((n_freq, n_out), complex),
        omega=np.where(mirrored, -places, places),
        mirrored=mirrored,
        weight=np.zeros((len(_IMAGES), n_freq, n_out), complex),
        tail=np.zeros((2, n_freq, n_out), complex),
    )


def _images(omega: FloatArray, period_s: float) -> FloatArray:
    """The first images (6, n_freq) of some angular frequencies."""
    return np.asarray(omega + 2 * np.pi / period_s * np.array(_IMAGES)[:, None])


def _last(period_s: float) -> complex:
    """Where F_1 and F_2 are seen: beyond all images that are taken from the response itself [1/s]."""
    return complex(2 * np.pi / period_s * _LAST)


def _terms(omega: FloatArray, delay_s: float, period_s: float, rate: int) -> list[tuple[ComplexArray, ...]]:
    """`fast`, `weight` and `tail` of outputs that were differentiated `rate` times, and their derivatives by delay."""
    images, powers = _images(omega, period_s), 1 / _last(period_s) ** np.array([1, 2])
    seen = np.stack([powers.real, powers.imag])
    # The line itself is the image k = 0: it is taken off the sum over all k as well.
    every = np.concatenate([omega[None], images])
    factor = (omega / every) ** (2 - rate) * hold_factor(every, delay_s, period_s)
    # hold(w_k) = (1 - exp(-j w T)) exp(-j w_k T_d) / (j w_k T): of the power -p of j w_k, all images together are
    sums = _power_sums(omega, delay_s, period_s, 5 - rate)
    common = (1 - np.exp(-1j * omega * period_s)) / period_s * (1j * omega) ** (2 - rate)
    found: list[tuple[ComplexArray, ...]] = []
    for by_delay in (False, True):
        own = -1j * every * factor if by_delay else factor
        whole = -sums[2 - rate : 5 - rate] if by_delay else sums[3 - rate : 6 - rate]
        # of F_0, F_1 / (j w_k) and F_2 / (j w_k)^2, less those that the response itself gives
        rest = common * whole - np.stack([(own / (1j * every) ** power).sum(axis=0) for power in range(3)])
        # F_1 / s + F_2 / s^2 = A(s) - F_0 at the last one, real and imaginary part
        tail = np.linalg.solve(seen.T, rest[1:])
        found.append((rest[0] - tail[0], own[1:], tail))
    return found


def _power_sums(omega: FloatArray, delay_s: float, period_s: float, highest: int) -> ComplexArray:
    """Sums over all k of `exp(-j w_k T_d) / (j w_k)^N` for N = 0 ... highest (highest + 1, n_freq).

    They are the z-transforms of delayed steps, ramps, ...: with `T_d = (n + p) T`, `T^N z^-n` times the coefficient of
    `x^(N - 1)` in `exp((1 - p) x) / (z - exp(x))`. The one of N = 0, an impulse between samples, is zero.
    """
    samples = delay_s / period_s
    whole = np.floor(samples + _SAME_INSTANT)
    # Delay as whole samples and a share: T_d = (n + p) T.
    part = max(samples - whole, 0.0)
    z = np.exp(1j * omega * period_s)
    coefficients: list[ComplexArray] = []
    for power in range(highest):
        # Coefficients of exp((1 - p) x) / (z - exp(x)) by power series division, one after the other.
        below = sum((each / factorial(power - index) for index, each in enumerate(coefficients)), 0 * z)
        coefficients.append(((1 - part) ** power / factorial(power) + below) / (z - 1))
    powers = [period_s ** (power + 1) * z**-whole * each for power, each in enumerate(coefficients)]
    return np.stack([0 * z, *powers])

"""What is to be known of a channel's poles and zeros, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from robid.arrays import FloatArray
from robid.models.external.fit.roots import Root, poles_of, zeros_of
from robid.models.external.fit.transfer import TransferMatrix

CANCELLING = 0.05
"""Distance of a pole and a zero over their magnitude below which they count as nearly cancelling."""

_WITHIN_REACH = 0.5  # of the magnitude: farther apart, an insignificant distance only tells of undetermined roots


@dataclass(frozen=True)
class Findings:
    """What is to be known of one channel's poles and zeros.

    Attributes:
        undetermined: Poles and zeros that the data do not determine, a sentence each.
        cancelling: Nearly cancelling pairs, a sentence each.
        pairs: Pole and zero [rad/s] of each of them.
        non_minimum_phase: Zeros in the right half plane, a sentence each.
        non_minimum_phase_zeros: Those zeros [rad/s].
        significant: Whether each of those is significantly there.
    """

    undetermined: tuple[str, ...]
    cancelling: tuple[str, ...]
    pairs: tuple[tuple[complex, complex], ...]
    non_minimum_phase: tuple[str, ...]
    non_minimum_phase_zeros: tuple[complex, ...]
    significant: tuple[bool, ...]


def find_findings(
    model: TransferMatrix,
    root: FloatArray,
    output: int = 0,
    input: int = 0,  # noqa: A002
    *,
    confidence: float = 0.95,
    largest_relative_std: float = 0.2,
) -> Findings:
    """Looks through the poles and zeros of one channel.

    Args:
        model: The transfer functions.
        root (n_param, n_root): Root of the covariance of `[numerators, denominator]` without the latter's first.
        output: Output of the channel.
        input: Input of the channel.
        confidence: Level of the tests.
        largest_relative_std: Relative deviation above which a pole or zero counts as undetermined.
    """
    poles, zeros = poles_of(model, root), zeros_of(model, root, output, input)
    nyquist = np.pi / model.sampling_period_s
    undetermined = [
        *_undetermined("pole", poles, nyquist, largest_relative_std),
        *_undetermined("zero", zeros, nyquist, largest_relative_std),
    ]
    cancelling = _cancelling(poles, zeros, float(np.sqrt(chi2.ppf(confidence, 2))))
    right = [each for each in zeros if each.place.real > 0]
    significant = [each.place.real > norm.ppf(confidence) * each.real_std for each in right]
    return Findings(
        undetermined=tuple(undetermined),
        cancelling=tuple(sentence for sentence, _ in cancelling),
        pairs=tuple(pair for _, pair in cancelling),
        non_minimum_phase=tuple(
            f"the zero at {_written(each.place)} rad/s is not of minimum phase{'' if sure else ', not significantly'}"
            for each, sure in zip(right, significant, strict=True)
        ),
        non_minimum_phase_zeros=tuple(each.place for each in right),
        significant=tuple(significant),
    )


def _undetermined(word: str, roots: Sequence[Root], nyquist: float, largest: float) -> list[str]:
    """Writes a sentence for each root beyond the sampling or with a large deviation."""
    found = []
    for each in roots:
        named = f"the {word} at {_written(each.place)} rad/s"
        if abs(each.place) > nyquist:
            found.append(
                f"{named} lies above the Nyquist frequency of {nyquist:.4g} rad/s: its value follows from the assumed"
                " structure, not from the samples"
            )
        elif not each.relative_std <= largest:
            found.append(f"{named} is not determined: its relative deviation is {100 * each.relative_std:.3g} %")
    return found


def _cancelling(
    poles: Sequence[Root], zeros: Sequence[Root], quantile: float
) -> list[tuple[str, tuple[complex, complex]]]:
    """Names poles and zeros that lie as near to each other as nothing, or as the data can tell."""
    found, left = [], list(zeros)
    for pole in poles:
        alike = [each for each in left if (each.place.imag == 0) == (pole.place.imag == 0)]
        if not alike:
            continue
        zero = alike[int(np.argmin([abs(each.place - pole.place) for each in alike]))]
        apart = abs(zero.place - pole.place) / max(abs(zero.place), abs(pole.place))
        unclear = apart <= _WITHIN_REACH and not pole.differs(zero, quantile)
        if apart <= CANCELLING or unclear:
            left.remove(zero)
            why = f"{100 * apart:.2g} % apart{', not significantly' if unclear else ''}"
            sentence = f"the pole at {_written(pole.place)} rad/s and the zero at {_written(zero.place)} rad/s"
            found.append((f"{sentence} nearly cancel: {why}", (pole.place, zero.place)))
    return found


def _written(place: complex) -> str:
    if place.imag == 0:
        return f"{place.real:.4g}"
    return f"{place.real:.4g} ± {abs(place.imag):.4g}j"

"""What is to be known of poles and zeros: undetermined, cancelling, unstable or non-minimum-phase ones, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from robid.arrays import FloatArray
from robid.fit.external.roots import Quantities, poles_of, root_moves, zeros_of
from robid.fit.external.transfer import TransferMatrix

CANCELLING = 0.05
"""Distance of a pole and a zero over their magnitude below which they count as nearly cancelling."""

_WITHIN_REACH = 0.5  # of the magnitude: farther apart, an insignificant distance only tells of undetermined roots


@dataclass(frozen=True)
class Findings:
    """What is to be known of one channel.

    Attributes:
        undetermined: Poles and zeros that the data do not determine, a sentence each.
        cancelling: Nearly cancelling pairs, a sentence each.
        pairs: Pole and zero [rad/s] of each of them.
        non_minimum_phase: Zeros in the right half plane, a sentence each.
        non_minimum_phase_zeros: Those zeros [rad/s].
        significant (n_non_minimum_phase,): Whether each is significantly there.
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
        sentence for each in (poles, zeros) for sentence in _undetermined(each, nyquist, largest_relative_std)
    ]
    cancelling, pairs = _cancelling(model, root, output, input, confidence)
    right = _right_half_plane(zeros, confidence)
    return Findings(
        undetermined=tuple(undetermined),
        cancelling=tuple(cancelling),
        pairs=tuple(pairs),
        non_minimum_phase=tuple(sentence for sentence, _, _ in right),
        non_minimum_phase_zeros=tuple(place for _, place, _ in right),
        significant=tuple(significant for _, _, significant in right),
    )


def _undetermined(roots: Quantities, nyquist: float, largest: float) -> list[str]:
    """Writes a sentence for each root beyond the sampling or with a large deviation."""
    found = []
    for name, place, relative in zip(roots.names, roots.places.tolist(), roots.relative_std.tolist(), strict=True):
        if name.endswith(".damping"):
            continue
        word = name.partition(".")[0]
        if abs(place) > nyquist:
            found.append(
                f"{word} at {_written(place)} rad/s lies above the Nyquist frequency of {nyquist:.4g} rad/s: its value"
                " follows from the assumed structure, not from the samples"
            )
        elif not relative <= largest:
            told = f"{100 * relative:.3g} %" if np.isfinite(relative) else "without limit"
            found.append(f"{word} at {_written(place)} rad/s is not determined: its relative deviation is {told}")
    return found


def _cancelling(
    model: TransferMatrix, root: FloatArray, output: int, input_: int, confidence: float
) -> tuple[list[str], list[tuple[complex, complex]]]:
    """Names poles and zeros that lie as near to each other as nothing, or as the data can tell."""
    sentences, pairs = [], []
    numerator = model.numerator[output, input_]
    n_pole, n_weight = len(model.denominator) - 1, len(numerator)
    first = (output * len(model.inputs) + input_) * n_weight
    below = np.concatenate([np.zeros((1, root.shape[1])), root[-n_pole:]])
    left = [place for place in model.zeros(output, input_).tolist() if place.imag >= 0]
    for pole in sorted((place for place in model.poles.tolist() if place.imag >= 0), key=abs):
        if not left:
            break
        zero = min(left, key=lambda place: abs(place - pole))
        size = max(abs(pole), abs(zero))
        distance = pole - zero
        moves = root_moves(model.denominator, below, pole) - root_moves(numerator, root[first : first + n_weight], zero)
        near = abs(distance) <= CANCELLING * size
        unclear = abs(distance) <= _WITHIN_REACH * size and not _differs(distance, moves, confidence)
        if near or unclear:
            left.remove(zero)
            pairs.append((pole, zero))
            why = f"{100 * abs(distance) / size:.2g} % apart" + (", not significantly" if unclear else "")
            sentences.append(
                f"the pole at {_written(pole)} rad/s and the zero at {_written(zero)} rad/s nearly cancel: {why}"
            )
    return sentences, pairs


def _differs(distance: complex, moves: FloatArray, confidence: float) -> bool:
    """Whether a distance is significantly different from zero, by what the covariance root moves it by (n_root,)."""
    both = np.stack([moves.real, moves.imag]) if distance.imag or np.abs(moves.imag).any() else moves.real[None]
    value = np.array([distance.real, distance.imag])[: len(both)]
    if not np.isfinite(both).all():
        return False
    statistic = value @ np.linalg.pinv(both @ both.T) @ value
    return bool(statistic > chi2.ppf(confidence, len(both)))


def _right_half_plane(zeros: Quantities, confidence: float) -> list[tuple[str, complex, bool]]:
    found = []
    limit = norm.ppf(confidence)
    deviations = zeros.standard_deviation.tolist()
    for kind, place, value, deviation in zip(
        zeros.kinds, zeros.places.tolist(), zeros.values.tolist(), deviations, strict=True
    ):
        if kind == "zero_frequency" or place.real <= 0:
            continue
        # A real zero is known by itself, a pair by its damping ratio, which is negative.
        significant = bool(abs(value) > limit * deviation)
        word = "significantly" if significant else "not significantly"
        found.append((f"the zero at {_written(place)} rad/s is not of minimum phase, {word}", place, significant))
    return found


def _written(place: complex) -> str:
    if place.imag == 0:
        return f"{place.real:.4g}"
    return f"{place.real:.4g} ± {abs(place.imag):.4g}j"

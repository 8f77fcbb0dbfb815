"""Poles, zeros and static gains with their deviations as an estimate, and what is remarkable about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2, norm

from robid.arrays import ComplexArray, FloatArray
from robid.models.conclusions import Row, estimate_of_rows, root_rows
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.transfer import TransferMatrix
from robid.results.estimate import Estimate
from robid.robot.parameters import INTEGRATOR_KIND


@dataclass(frozen=True)
class Root:
    """A real root, or that with positive imaginary part of a pair."""

    place: complex  # where it is [rad/s]
    moves: ComplexArray  # (n_root,): what each column of the coefficients' covariance root moves it by [rad/s]

    @property
    def relative_std(self) -> float:
        """Standard deviation of the magnitude, a rate or a natural frequency, over the magnitude."""
        size = abs(self.place)
        if size == 0:
            return float("inf")
        return float(np.linalg.norm((np.conj(self.place) * self.moves).real)) / size**2

    @property
    def real_std(self) -> float:
        """Standard deviation of the real part [rad/s]."""
        return float(np.linalg.norm(self.moves.real))

    def differs(self, other: Root, quantile: float) -> bool:
        """Whether it lies apart from another root of the same fit by more deviations than chance explains."""
        distance, moves = self.place - other.place, self.moves - other.moves
        both = np.stack([moves.real, moves.imag])
        value = np.array([distance.real, distance.imag])
        if not np.isfinite(both).all():
            return False
        kept = np.linalg.norm(both, axis=1) > 0
        # Roots of one fit are correlated, so the difference of their moves counts, not the two variances; a real root
        # has no imaginary part to compare.
        covariance = (both @ both.T)[np.ix_(kept, kept)]
        return bool(value[kept] @ np.linalg.pinv(covariance) @ value[kept] > quantile**2)


def poles_of(model: TransferMatrix, root: FloatArray) -> tuple[Root, ...]:
    """Returns the poles, slow ones first; `root` (n_param, n_root) is as in `block_parameters`."""
    n_pole = len(model.denominator) - 1
    return _roots(model.denominator, np.concatenate([np.zeros((1, root.shape[1])), root[-n_pole:]]))


def zeros_of(model: TransferMatrix, root: FloatArray, output: int = 0, input: int = 0) -> tuple[Root, ...]:  # noqa: A002
    """Returns the zeros of one channel, slow ones first."""
    n_weight = model.numerator.shape[-1]
    first = (output * len(model.inputs) + input) * n_weight
    return _roots(model.numerator[output, input], root[first : first + n_weight])


def _roots(polynomial: FloatArray, root: FloatArray) -> tuple[Root, ...]:
    """Finds the roots of a polynomial (n_power,) with a covariance root (n_power, n_root) of its coefficients."""
    found = sorted(np.roots(polynomial).astype(complex).tolist(), key=lambda each: (abs(each), each.real))
    upper = [each for each in found if each.imag >= 0]
    # At a root r of p(s) a change dp moves it by -dp(r) / p'(r); at a double root p' vanishes and nothing is told.
    slope = np.polyder(polynomial)
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = [-(np.vander([each], len(polynomial))[0] @ root) / np.polyval(slope, each) for each in upper]
    return tuple(Root(place, np.asarray(move, dtype=complex)) for place, move in zip(upper, moves, strict=True))


@dataclass(frozen=True)
class Integrators:
    """The poles of a block that cannot be told from zero: what they drive goes on as long as it is commanded."""

    count: int = 0  # how many, the slowest of all poles
    longest_s: float = float("inf")  # how long the longest shot lasts [s]

    @property
    def sentence(self) -> str:
        """Says what they are."""
        told = "its slowest pole is an integrator" if self.count == 1 else f"{self.count} poles are integrators"
        return f"{told}: shots of {self.longest_s:.3g} s do not tell it from zero"


def integrators_of(model: TransferMatrix, root: FloatArray, longest_s: float, confidence: float) -> Integrators:
    """Counts poles whose time constants are longer than any shot, or that may be zero and turn less than once in one.

    Below 2 pi over its length no shot has a line, so nothing tells where such a pole lies, only what it adds to faster
    motions: those of an integrator. `root` is as in `block_parameters`.
    """
    half, count = norm.ppf(0.5 + 0.5 * confidence), 0
    for one in poles_of(model, root):
        maybe_zero = bool(abs(one.place.real) <= half * one.real_std) and abs(one.place) * longest_s < 2 * np.pi
        if not (abs(one.place) * longest_s < 1 or (one.place.imag == 0 and maybe_zero)):
            break
        count += 1 + (one.place.imag != 0)
    return Integrators(count, longest_s)


_NONE = Integrators()


def block_parameters(
    name: str,
    channels: Sequence[str],
    units: Sequence[str],
    model: TransferMatrix,
    root: FloatArray,
    integrators: Integrators = _NONE,
) -> list[Row]:
    """Turns the coefficients of a block into poles, zeros and static gains.

    A real root is given as its rate, positive in the left half plane, a pair as natural frequency and damping ratio.
    Integrators have gains per second in place of static ones. Channels are named output by output. `root`
    (n_coefficient, n_root) is one of the covariance of numerators, then of the denominator without its first.
    """
    nyquist, count = np.pi / model.sampling_period_s, integrators.count
    rows = _rows_of_roots(name, "pole", poles_of(model, root), nyquist, integrators)
    for channel, unit, place in zip(channels, units, np.ndindex(model.numerator.shape[:2]), strict=True):
        last = (int(np.ravel_multi_index(place, model.numerator.shape[:2])) + 1) * model.numerator.shape[2] - 1
        with np.errstate(divide="ignore", invalid="ignore"):
            # Of n integrators K = b_0 / a_n, the static gain without any: dK = (db_0 - K da_n) / a_n.
            below = model.denominator[-1 - count]
            gain = model.numerator[place][-1] / below
            moved = root[-1 - count] if count < len(model.denominator) - 1 else np.zeros(root.shape[1])
            slope = np.asarray((root[last] - gain * moved) / below)
        kind = "gain_per_second" if count else "gain"
        rows.append(Row(f"{channel}.{kind}", kind, unit, float(gain), abs(float(gain)), slope))
        rows += _rows_of_roots(channel, "zero", zeros_of(model, root, *place), nyquist)
    return rows


def _rows_of_roots(
    owner: str, kind: str, found: Sequence[Root], nyquist: float, integrators: Integrators = _NONE
) -> list[Row]:
    rows, left = [], integrators.count
    for number, one in enumerate(found, start=1):
        is_real, reachable, name = one.place.imag == 0, bool(abs(one.place) < nyquist), f"{owner}.{kind}{number}"
        if left > 0:
            # How far from zero it may be is related to the slowest that a shot shows.
            slowest, parts = 1 / integrators.longest_s, [("" if is_real else ".real", -one.place.real, -one.moves.real)]
            parts += [] if is_real else [(".imaginary", one.place.imag, one.moves.imag)]
            rows += [
                Row(f"{name}{end}", INTEGRATOR_KIND, "rad/s", value, slowest, moves) for end, value, moves in parts
            ]
            left -= 1 + (not is_real)
        else:
            rows += root_rows(name, kind, one.place, one.moves, is_real=is_real, reachable=reachable)
    return rows


def gain_unit(output: str, command: str, integrators: int = 0) -> str:
    """Writes the unit of a gain from a command to an output, per second for each integrator."""
    each = {0: "", 1: "/s"}.get(integrators, f"/s^{integrators}")
    if f"{output}{each}" == command:
        return "1"
    if output == command:
        return f"1{each}"
    return f"{output}{each}/({command})" if "/" in command else f"{output}{each}/{command}"


def estimate_of(
    blocks: Sequence[Sequence[Row]],
    options: ExternalOptions,
    undetermined: Sequence[str],
    status: str,
    advice: str,
    *,
    rule: str = "the residual, as coloured as it is",
    degrees_of_freedom: FloatArray | None = None,
) -> Estimate:
    """Puts the parameters of all blocks together; blocks are independent of each other.

    Intervals are those of Student's distribution where its `degrees_of_freedom` (n_param,) are given.
    """
    roots = [np.array([row.moves for row in rows]) for rows in blocks]
    return estimate_of_rows(
        [row for rows in blocks for row in rows],
        block_diag(*(root @ root.T for root in roots)),
        rule,
        status,
        advice,
        confidence=options.confidence,
        identifiable_relative_std=options.identifiable_relative_std,
        undetermined=undetermined,
        degrees_of_freedom=degrees_of_freedom,
    )


CANCELLING = 0.05
"""Distance of a pole and a zero over their magnitude below which they count as nearly cancelling."""

_WITHIN_REACH = 0.5  # of the magnitude: farther apart, an insignificant distance only tells of undetermined roots


@dataclass(frozen=True)
class Findings:
    """What is to be known of one channel's poles and zeros."""

    undetermined: tuple[str, ...]  # poles and zeros that the data do not determine, a sentence each
    cancelling: tuple[str, ...]  # nearly cancelling pairs, a sentence each
    pairs: tuple[tuple[complex, complex], ...]  # pole and zero [rad/s] of each of them
    non_minimum_phase: tuple[str, ...]  # zeros in the right half plane, a sentence each
    significant: tuple[bool, ...]  # whether each of those is significantly there


def find_findings(
    model: TransferMatrix,
    root: FloatArray,
    output: int = 0,
    input: int = 0,  # noqa: A002
    *,
    confidence: float = 0.95,
    largest_relative_std: float = 0.2,
    integrators: int = 0,
) -> Findings:
    """Looks through the poles and zeros of one channel.

    `root` (n_param, n_root) is as in `block_parameters`; poles and zeros of a larger relative deviation than
    `largest_relative_std` count as undetermined, but for the slowest poles where they are integrators.
    """
    poles, zeros = poles_of(model, root), zeros_of(model, root, output, input)
    nyquist = np.pi / model.sampling_period_s
    undetermined = [
        *_undetermined("pole", _without_slowest(poles, integrators), nyquist, largest_relative_std),
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
        significant=tuple(significant),
    )


def _without_slowest(poles: Sequence[Root], count: int) -> Sequence[Root]:
    """Leaves out so many poles, both of a pair counted, the slowest first."""
    for index, one in enumerate(poles):
        if count <= 0:
            return poles[index:]
        count -= 1 + (one.place.imag != 0)
    return ()


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

"""Poles, zeros and gains as quantities with deviations, by the delta method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.external.transfer import TransferMatrix


@dataclass(frozen=True)
class Quantities:
    """What polynomial coefficients say in the words of poles and zeros.

    Attributes:
        names: Name of each, as in `gain`, `pole1`, `pole2.frequency`, `pole2.damping`.
        kinds: Kind of each: `gain`, `pole`, `pole_frequency`, `pole_damping`, `zero`, ...
        units: Unit of each.
        values (n_value,): Values: a real root itself [rad/s], a pair's natural frequency [rad/s] and damping ratio [1].
        root (n_value, n_root): A root of their covariance.
        places (n_value,): The root of the polynomial that each describes [rad/s]; NaN for a gain.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    root: FloatArray
    places: ComplexArray

    @property
    def standard_deviation(self) -> FloatArray:
        """Standard deviation (n_value,) of each."""
        return np.asarray(np.linalg.norm(self.root, axis=1))

    @property
    def relative_std(self) -> FloatArray:
        """Standard deviation over magnitude (n_value,); that of a damping ratio is its own."""
        size = np.array([1.0 if kind.endswith("damping") else abs(value) for kind, value in self._kinds_and_values()])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.standard_deviation / size)

    def _kinds_and_values(self) -> list[tuple[str, float]]:
        return list(zip(self.kinds, self.values.tolist(), strict=True))

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n_value, n_value)."""
        return np.asarray(self.root @ self.root.T)


def join(*parts: Quantities) -> Quantities:
    """Strings quantities of one covariance root together."""
    return Quantities(
        names=tuple(name for part in parts for name in part.names),
        kinds=tuple(kind for part in parts for kind in part.kinds),
        units=tuple(unit for part in parts for unit in part.units),
        values=np.concatenate([part.values for part in parts]),
        root=np.concatenate([part.root for part in parts]),
        places=np.concatenate([part.places for part in parts]),
    )


def poles_of(model: TransferMatrix, root: FloatArray) -> Quantities:
    """Returns the poles, slow ones first, with deviations.

    Args:
        model: The transfer functions.
        root (n_param, n_root): Root of the covariance of `[numerators, denominator]` without the latter's first.
    """
    n_pole = len(model.denominator) - 1
    own = np.concatenate([np.zeros((1, root.shape[1])), root[-n_pole:]])
    return _describe("pole", model.denominator, own)


def zeros_of(model: TransferMatrix, root: FloatArray, output: int = 0, input: int = 0) -> Quantities:  # noqa: A002
    """Returns the zeros of one channel, slow ones first, with deviations."""
    return _describe("zero", model.numerator[output, input], root[_place(model, output, input)])


def gain_of(model: TransferMatrix, root: FloatArray, output: int = 0, input: int = 0) -> Quantities:  # noqa: A002
    """Returns the static gain of one channel with its deviation."""
    last = root[_place(model, output, input)][-1]
    level = model.denominator[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = model.numerator[output, input, -1] / level
        move = (last - gain * root[-1]) / level
    return Quantities(("gain",), ("gain",), ("1",), np.array([gain]), move[None], np.array([np.nan + 0j]))


def channel_quantities(model: TransferMatrix, root: FloatArray, output: int = 0, input: int = 0) -> Quantities:  # noqa: A002
    """Returns gain, poles and zeros of one channel."""
    return join(gain_of(model, root, output, input), poles_of(model, root), zeros_of(model, root, output, input))


def _place(model: TransferMatrix, output: int, input_: int) -> slice:
    n_weight = model.numerator.shape[-1]
    first = (output * len(model.inputs) + input_) * n_weight
    return slice(first, first + n_weight)


def root_moves(polynomial: FloatArray, root: FloatArray, place: complex) -> ComplexArray:
    """Returns what each column of a covariance root (n_power, n_root) of a polynomial moves one of its roots by."""
    powers = place ** np.arange(len(polynomial) - 1, -1.0, -1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-(powers @ root) / np.polyval(np.polyder(polynomial), place))


def _describe(word: str, polynomial: FloatArray, root: FloatArray) -> Quantities:
    """Describes the roots of a polynomial (n_power,) by the covariance root (n_power, n_root) of its coefficients."""
    names, kinds, units, values, rows, places = [], [], [], [], [], []
    found = sorted(np.roots(polynomial).astype(complex).tolist(), key=lambda each: (abs(each), each.real))
    upper = [each for each in found if each.imag >= 0]
    for number, place in enumerate(upper, start=1):
        moves = root_moves(polynomial, root, place)
        if place.imag == 0:
            names.append(f"{word}{number}")
            kinds.append(word)
            units.append("rad/s")
            values.append(place.real)
            rows.append(moves.real)
            places.append(place)
            continue
        size = abs(place)
        frequency = np.real(np.conj(place) * moves) / size
        damping = -moves.real / size + place.real / size**2 * frequency
        names += [f"{word}{number}.frequency", f"{word}{number}.damping"]
        kinds += [f"{word}_frequency", f"{word}_damping"]
        units += ["rad/s", "1"]
        values += [size, -place.real / size]
        rows += [frequency, damping]
        places += [place, place]
    flat = np.array(rows).reshape(len(rows), root.shape[1])
    return Quantities(
        tuple(names), tuple(kinds), tuple(units), np.array(values, dtype=float), flat, np.array(places, dtype=complex)
    )

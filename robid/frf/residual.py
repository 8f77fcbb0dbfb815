"""Residuals of an estimator: how a measured response is compared with a modelled one, each a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray

EstimatorKind = Literal["lls", "nls", "llsm"]

_TURN = 2 * np.pi


@dataclass(frozen=True)
class Residual:
    """Measured minus modelled response, Wernholt and Moberg (2008), eq. 4c; other residuals override what differs."""

    name: EstimatorKind
    parts: int  # Real numbers that each element's residual has: 2 where it is complex, 1 where it is real
    drops_noise: bool  # Whether elements that drown in noise are left out, as their residual is biased
    from_afar: EstimatorKind  # Name of the estimator that comes closer from starts far away

    def compare(self, measured: ComplexArray, modelled: ComplexArray) -> ComplexArray:
        """Residual of each element [1, or as the responses]."""
        return np.asarray(measured - modelled)

    def transform(self, response: ComplexArray) -> ComplexArray | FloatArray:
        """What `subtract` takes of a response, for one that is compared many times; real where `parts` is 1."""
        return response

    def subtract(
        self, measured: ComplexArray | FloatArray, modelled: ComplexArray | FloatArray
    ) -> ComplexArray | FloatArray:
        """Residual of responses that are transformed already."""
        return np.asarray(measured - modelled)

    def part(self, values: ComplexArray) -> ComplexArray:
        """The part of a residual's complex derivatives or covariances that it has."""
        return values

    def divisor(self, response: ComplexArray) -> ComplexArray:
        """What an error of a response is divided by to be one of the residual; of the shape of the response."""
        return np.ones_like(response)

    def per_relative(self, response: ComplexArray) -> ComplexArray:
        """What a relative error of a response is multiplied with to be one of the residual."""
        return response


class _Logarithm(Residual):
    """Logarithm of measured over modelled response: Wernholt and Moberg (2008), eq. 7c.

    What is exactly zero has none and must not count; it is taken for one.
    """

    def compare(self, measured: ComplexArray, modelled: ComplexArray) -> ComplexArray:
        return self.part(np.log(_shown(measured) / _shown(modelled)))

    def transform(self, response: ComplexArray) -> ComplexArray | FloatArray:
        result = np.empty(response.shape, complex)
        result.real = _log_magnitude(response)
        result.imag = np.arctan2(response.imag, response.real)  # of zero it is zero
        return result

    def subtract(
        self, measured: ComplexArray | FloatArray, modelled: ComplexArray | FloatArray
    ) -> ComplexArray | FloatArray:
        residual = np.asarray(measured - modelled)
        # Two phases between -pi and pi differ by up to two turns; their quotient has the branch nearest to zero.
        turns = residual.imag
        turns -= _TURN * np.round(turns / _TURN)
        return residual

    def divisor(self, response: ComplexArray) -> ComplexArray:
        # d log G = dG / G, so that a relative error is the residual's own.
        return _shown(response)

    def per_relative(self, response: ComplexArray) -> ComplexArray:
        return np.ones_like(response)


class _Magnitude(_Logarithm):
    """Real part of that logarithm: phases do not count."""

    def transform(self, response: ComplexArray) -> ComplexArray | FloatArray:
        return _log_magnitude(response)

    def subtract(
        self, measured: ComplexArray | FloatArray, modelled: ComplexArray | FloatArray
    ) -> ComplexArray | FloatArray:
        return np.asarray(measured - modelled)

    def part(self, values: ComplexArray) -> ComplexArray:
        return np.asarray(values.real + 0j)


LOGARITHM = _Logarithm("lls", parts=2, drops_noise=True, from_afar="lls")
MAGNITUDE = _Magnitude("llsm", parts=1, drops_noise=True, from_afar="llsm")
PLAIN = Residual("nls", parts=2, drops_noise=False, from_afar="lls")
RESIDUALS: dict[EstimatorKind, Residual] = {each.name: each for each in (LOGARITHM, MAGNITUDE, PLAIN)}


def _log_magnitude(response: ComplexArray) -> FloatArray:
    # Half the logarithm of the square saves the root of `abs`; this runs for every line of every step of a fit.
    square = response.real**2 + response.imag**2
    return np.asarray(0.5 * np.log(square if square.all() else np.where(square == 0, 1.0, square)))


def _shown(response: ComplexArray) -> ComplexArray:
    return response if response.all() else np.where(response == 0, 1.0, response)

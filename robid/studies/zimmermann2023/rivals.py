"""Which models have lower figures than the optimal one, beyond chance over the individuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.studies.zimmermann2023.figures import Found
from robid.studies.zimmermann2023.scatter import scatter, scatters_differ

_TIE_LEVEL = 0.95


def differs(one: FloatArray, other: FloatArray) -> bool:
    """Tells whether two figures differ by more than chance over the individuals, which both were measured on.

    Args:
        one (n_seed,): Figures of one model, above 0.
        other (n_seed,): Those of another.

    Returns:
        Whether 0 lies outside the 95 % interval of the mean logarithm of their ratio; never with one individual.
    """
    ratio = np.log(one / other)
    if ratio.size < 2:
        return False
    reach = student.ppf(0.5 + 0.5 * _TIE_LEVEL, ratio.size - 1) * ratio.std(ddof=1) / np.sqrt(ratio.size)
    return bool(abs(ratio.mean()) > reach)


@dataclass(frozen=True)
class Rivals:
    """Models with as few configurations as the optimal one.

    Attributes:
        lower: Those that are surely below it.
        tied: Those that differ from it by no more than chance over the individuals.
    """

    lower: tuple[str, ...]
    tied: tuple[str, ...]


def rivals(found: Found) -> dict[str, Rivals]:
    """Returns the optimal model's rivals by `deviation`, as fits state it, and by `scatter` about the truth."""
    own = found.models[found.study.optimal]
    others = [found.models[name] for name in found.small if name != found.study.optimal]
    stated = {
        one.name: (
            float(np.median(one.average_fit_std / own.average_fit_std)),
            differs(one.average_fit_std, own.average_fit_std),
        )
        for one in others
    }
    scattered = {
        one.name: (scatter(one.error) / scatter(own.error), scatters_differ(one.error, own.error)) for one in others
    }
    return {"deviation": _rivals(stated), "scatter": _rivals(scattered)}


def _rivals(ratios: Mapping[str, tuple[float, bool]]) -> Rivals:
    """By each model's figure over the optimal one's, and whether that is more than chance."""
    lower = tuple(name for name, (ratio, surely) in ratios.items() if surely and ratio < 1)
    return Rivals(lower, tuple(name for name, (_, surely) in ratios.items() if not surely))

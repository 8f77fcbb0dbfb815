"""Which models have lower figures than the optimal one, beyond chance over the individuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robid.studies.over_individuals import differs
from robid.studies.zimmermann2023.figures import Found
from robid.studies.zimmermann2023.scatter import Mean, scatter, scatters_differ


@dataclass(frozen=True)
class Rivals:
    """Models with as few configurations as the optimal one.

    Attributes:
        lower: Those that are surely below it.
        tied: Those that differ from it by no more than chance over the individuals.
    """

    lower: tuple[str, ...]
    tied: tuple[str, ...]


def rivals(found: Found, mean: Mean) -> dict[str, Rivals]:
    """Returns the optimal model's rivals by `deviation`, as fits state it, and by `scatter` about the truth.

    Args:
        found: What the study found.
        mean: Mean over the springs.
    """
    own = found.models[found.study.optimal]
    others = [found.models[name] for name in found.small if name != found.study.optimal]
    stated, scattered = {}, {}
    for one in others:
        pair = one.stated(mean), own.stated(mean)
        stated[one.name] = float(np.median(pair[0] / pair[1])), differs(*pair)
        ratio = scatter(one.error, mean) / scatter(own.error, mean)
        scattered[one.name] = ratio, scatters_differ(one.error, own.error, mean)
    return {"deviation": _rivals(stated), "scatter": _rivals(scattered)}


def _rivals(ratios: Mapping[str, tuple[float, bool]]) -> Rivals:
    """By each model's figure over the optimal one's, and whether that is more than chance."""
    lower = tuple(name for name, (ratio, surely) in ratios.items() if surely and ratio < 1)
    return Rivals(lower, tuple(name for name, (_, surely) in ratios.items() if not surely))

"""Limits of what transfer functions may be off, and doubts from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.models.external.fit.agreement import Agreement
from robid.results.doubt import Doubt

NRMSE_LIMIT = 0.9
"""Least normalised root mean square of a model that may be used."""

MODEL_ERROR = 0.01
"""Share of the motion that a model of a robot may be off without a doubt."""

_BEYOND = 1.5  # of what is expected


def expected_std(found: Agreement, parameter_std: float = 0.0) -> float:
    """Error that noise, parameters and the assumed model error give; NaN where the noise is unknown."""
    return float(np.sqrt(found.noise_std**2 + parameter_std**2 + (MODEL_ERROR * found.motion_std) ** 2))


def excess_doubts(found: Sequence[Agreement], expected: Sequence[float]) -> Iterator[Doubt]:
    """Yields a doubt where an output's error is beyond what is expected of it."""
    ratio = np.nan_to_num([one.error_std / each for one, each in zip(found, expected, strict=True)])
    worst = int(np.argmax(ratio))
    if ratio[worst] > _BEYOND:
        told = (
            f"{found[worst].output} is off by {ratio[worst]:.2g} times what noise and a model error of "
            f"{MODEL_ERROR:.0%} of the motion explain ({found[worst].place})"
        )
        yield Doubt("model", told, decisive=False, strength=float(ratio[worst]) / _BEYOND)

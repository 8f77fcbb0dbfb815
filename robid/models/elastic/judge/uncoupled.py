"""Motion that data show and that a model cannot have at all."""

from __future__ import annotations

import numpy as np

from robid.models.elastic.judge.fitted import FittedModel
from robid.results.doubt import Doubt, two_digits

_CLEAR = 10.0
"""Power over variance from which an element counts as seen (10 dB)."""

_LEAST_SHARE = 0.01
"""Of what moves the motors themselves, from which motion by another motor's torque matters."""

_FEW = 3


def uncoupled_doubts(fitted: FittedModel) -> tuple[Doubt, ...]:
    """Doubts a model that lets no torque of one motor move another where the data show that it does.

    No logarithm compares a response with zero, so no residual tells of it.

    Args:
        fitted: The model and the response.
    """
    problem, frf = fitted.problem, fitted.problem.frf
    never = problem.model_response(fitted.internal) == 0
    if not never.any():
        return ()
    power, variance = np.abs(frf.response) ** 2, frf.element_variance()
    seen = never & np.isfinite(variance) & (variance > 0) & (power > _CLEAR * variance)
    rows = [frf.output_names.index(name) if name in frf.output_names else None for name in frf.input_names]
    found = []
    for column, name in enumerate(frf.input_names):
        for at, row in enumerate(rows):
            own = rows[column]
            if row is None or own is None or seen[..., row, column].sum() < _FEW:
                continue
            both = power[..., row, at] * power[..., own, column]
            share = np.sqrt(np.median((power[..., row, column] / np.sqrt(both))[seen[..., row, column]]))
            found.append((float(share), name, frf.input_names[at]))
    share, name, other = max(found, default=(0.0, "", ""))
    told = (
        f"the torque of {name} moves {other} by {two_digits(100 * share)} % of what moves them themselves, and nothing "
        "in the model couples them"
    )
    return (Doubt("missing_spring", told, decisive=False, strength=share / _LEAST_SHARE),) if found else ()

"""What every validation says, whatever the model's family."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, FloatArray, Quantity
from robid.results.estimate import Estimate
from robid.results.grade import Grade
from robid.robot.parameters import FRICTION_KIND

_SPRING_TOLERANCE = 0.02


@dataclass(frozen=True)
class Recovery:
    """Fitted against true values."""

    names: Annotated[tuple[str, ...], Quantity("1", "known", "Parameters with a known truth")]
    kinds: Annotated[tuple[str, ...], Quantity("1", "known")]
    truth: Annotated[FloatArray, Quantity("as in the model", "known", "True values")]
    # Error over the true value; the error itself for relative errors of friction and where the truth is zero
    relative_error: Annotated[
        FloatArray, Quantity("1", "known", "Error over the true value; the error itself for friction")
    ]
    covered: Annotated[BoolArray, Quantity("1", "known", "Whether the interval contains the truth")]
    identifiable: Annotated[BoolArray, Quantity("1", "known", "Whether the parameter counts as identifiable")]

    @property
    def contained(self) -> tuple[int, int]:
        """How many intervals of the model's identifiable parameters contain the truth, and how many there are.

        Corrections of friction are none of these, as in every other count that a reader sees.
        """
        of_model = self.identifiable & (np.array(self.kinds, dtype=str) != FRICTION_KIND)
        return int(self.covered[of_model].sum()), int(of_model.sum())

    @property
    def coverage(self) -> float | None:
        """Share of the identifiable parameters whose interval holds the truth; None without any."""
        return float(self.covered[self.identifiable].mean()) if self.identifiable.any() else None

    def within(self, kind: str, tolerance: float) -> tuple[int, int]:
        """How many parameters of a kind are within a tolerance of the truth, and how many there are."""
        error = self.relative_error[np.array(self.kinds, dtype=str) == kind]
        return int((np.abs(error) <= tolerance).sum()), error.size


def recover(estimate: Estimate, truth: Mapping[str, float]) -> Recovery:
    """Compares estimates with the truth.

    Args:
        estimate: What a fit found.
        truth: True value by parameter name; names that the fit does not estimate are left out.
    """
    known = [index for index, name in enumerate(estimate.names) if name in truth]
    names, kinds = (tuple(words[index] for index in known) for words in (estimate.names, estimate.kinds))
    values = np.array([truth[name] for name in names], float)
    size = np.where((np.array(kinds, dtype=str) == "friction") | (values == 0), 1.0, np.abs(values))
    return Recovery(
        names=names,
        kinds=kinds,
        truth=values,
        relative_error=(estimate.value[known] - values) / size,
        covered=(estimate.lower[known] <= values) & (values <= estimate.upper[known]),
        identifiable=estimate.identifiable[known].astype(bool),
    )


def recovery_sentence(recovery: Recovery) -> str:
    """Says how much of the truth was found; empty where none is known."""
    (within, known), (found, every) = recovery.within("stiffness", _SPRING_TOLERANCE), recovery.contained
    parts = [f"{within} of {known} springs within 2 %"] if known else []
    parts += [f"{found} of {every} intervals contain it"] if every else []
    return f"Against the truth: {', '.join(parts)}." if parts else ""


@dataclass(frozen=True)
class Outcome:
    """Whether a model held on data that its fit never saw."""

    ok: bool  # Whether the model may be used on data like these
    verdict: str  # The same in words, to follow "the model"
    grade: Grade  # How far to trust the model
    recovery: Recovery  # Its parameters against the true ones; empty for a real robot

"""Options of a position-dependent fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import comb
from typing import Literal


@dataclass(frozen=True)
class BasisOptions:
    """Functions of the scheduling parameters, besides the constant one."""

    kind: Literal["polynomials", "splines"] = field(
        default="polynomials", metadata={"description": "Powers up to a total degree, or B-splines."}
    )
    degree: int = field(default=4, metadata={"description": "Of the powers, or of the splines' pieces.", "ge": 1})
    pieces: int = field(default=2, metadata={"description": "Intervals of each parameter's splines.", "ge": 1})
    center: tuple[float, ...] = field(
        default=(), metadata={"description": "Where each parameter's powers are counted from; empty for zero."}
    )

    def count(self, n_scheduling: int) -> int:
        """Returns the number of functions of some scheduling parameters, the constant one counted."""
        if self.kind == "splines":
            return int((self.pieces + self.degree) ** n_scheduling)
        return comb(n_scheduling + self.degree, self.degree)


@dataclass(frozen=True)
class SparseBasisOptions:
    """How the basis is searched."""

    smallest: float = field(default=3e-3, metadata={"description": "Relative norm of a block that is none.", "gt": 0})
    passes: int = field(default=12, metadata={"description": "Passes of the search.", "ge": 1})


@dataclass(frozen=True)
class SparsityOptions:
    """When blocks are dropped and when the penalised fit ends."""

    epsilon: float = field(default=1e-3, metadata={"description": "Relative norm of a block that counts.", "gt": 0})
    zero: float = field(default=1e-5, metadata={"description": "Relative norm of a block that is gone.", "gt": 0})
    reweightings: int = field(default=10, metadata={"description": "Renewals of the weights at most.", "ge": 1})
    settled: float = field(default=1e-2, metadata={"description": "Change that ends the renewals.", "gt": 0})
    tolerance: float = field(default=1e-5, metadata={"description": "Decrease that ends a descent.", "gt": 0})
    step_limit: int = field(default=30, metadata={"description": "Steps of one descent at most.", "ge": 1})


@dataclass(frozen=True)
class PathOptions:
    """Which prices are tried and how one is chosen."""

    count: int = field(default=10, metadata={"description": "Prices along the path.", "ge": 2})
    smallest: float = field(default=1.0, metadata={"description": "Least price, in mean squared errors.", "gt": 0})
    largest: float = field(default=1e4, metadata={"description": "Greatest price, in mean squared errors.", "gt": 0})
    allowance: float = field(default=0.05, metadata={"description": "Excess allowed for sparsity.", "ge": 0})


@dataclass(frozen=True)
class LpvOptions:
    """Options of a fit."""

    order: int = field(default=3, metadata={"description": "States of the model without integrators.", "ge": 1})
    integrators: tuple[int, ...] = field(
        default=(), metadata={"description": "How often each output integrates; not at all when empty."}
    )
    weighted: bool = field(
        default=True, metadata={"description": "Whether lines weigh by their variance, or all alike."}
    )
    weight_window: int = field(default=9, metadata={"description": "Lines that a weight's variance averages.", "ge": 1})
    sparse_basis: SparseBasisOptions = field(
        default_factory=SparseBasisOptions, metadata={"description": "How the states' basis is searched."}
    )
    sparsity: SparsityOptions = field(
        default_factory=SparsityOptions,
        metadata={"description": "When blocks are dropped and when the penalised fit ends."},
    )
    path: PathOptions = field(
        default_factory=PathOptions, metadata={"description": "Which prices are tried and how one is chosen."}
    )

"""Options of a position-dependent fit."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Literal

from robid.arrays import group, option


@dataclass(frozen=True)
class BasisOptions:
    """Functions of the scheduling parameters, besides the constant one."""

    kind: Literal["polynomials", "splines"] = option("polynomials", "Powers up to a total degree, or B-splines.")
    degree: int = option(4, "Of the powers, or of the splines' pieces.", ge=1, le=20)
    pieces: int = option(2, "Intervals of each parameter's splines.", ge=1, le=1_000)
    center: tuple[float, ...] = option((), "Origin of each parameter's powers; empty for zero.")

    def count(self, n_scheduling: int) -> int:
        """Returns the number of functions of some scheduling parameters, the constant one counted."""
        if self.kind == "splines":
            return int((self.pieces + self.degree) ** n_scheduling)
        return comb(n_scheduling + self.degree, self.degree)


@dataclass(frozen=True)
class SparseBasisOptions:
    """How the basis is searched."""

    smallest: float = option(3e-3, "Relative norm of a block that is none.", gt=0)
    passes: int = option(12, "Passes of the search.", ge=1, le=10_000)


@dataclass(frozen=True)
class SparsityOptions:
    """When blocks are dropped and when the penalised fit ends."""

    epsilon: float = option(1e-3, "Relative norm of a block that counts.", gt=0)
    zero: float = option(1e-5, "Relative norm of a block that is gone.", gt=0)
    reweightings: int = option(10, "Renewals of the weights at most.", ge=1, le=10_000)
    settled: float = option(1e-2, "Change that ends the renewals.", gt=0)
    tolerance: float = option(1e-5, "Decrease that ends a descent.", gt=0)
    step_limit: int = option(30, "Steps of one descent at most.", ge=1, le=100_000)


@dataclass(frozen=True)
class PathOptions:
    """Which prices are tried and how one is chosen."""

    count: int = option(10, "Prices along the path.", ge=2, le=1_000)
    smallest: float = option(1.0, "Least price, in mean squared errors.", gt=0)
    largest: float = option(1e4, "Greatest price, in mean squared errors.", gt=0)
    allowance: float = option(0.05, "Excess allowed for sparsity.", ge=0)


@dataclass(frozen=True)
class LpvOptions:
    """Options of a fit."""

    order: int = option(3, "States of the model without integrators.", ge=1, le=100)
    integrators: tuple[int, ...] = option((), "How often each output integrates; not at all when empty.")
    weighted: bool = option(True, "Whether lines have weights by their variance, or equal weights.")
    weight_window: int = option(9, "Lines that a weight's variance averages.", ge=1, le=10_001)
    sparse_basis: SparseBasisOptions = group(SparseBasisOptions, "Search of the states' basis.")
    sparsity: SparsityOptions = group(SparsityOptions, "When blocks are dropped and when the penalised fit ends.")
    path: PathOptions = group(PathOptions, "Which prices are tried and how one is chosen.")

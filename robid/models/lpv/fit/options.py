"""Options of a position-dependent fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import comb
from typing import Literal


@dataclass(frozen=True)
class BasisOptions:
    """Functions of the scheduling parameters, besides the constant one.

    Attributes:
        kind: Powers up to a total degree, or B-splines of evenly spaced knots.
        degree: Of the powers, or of the splines' pieces.
        pieces: Intervals of each parameter's splines.
        center: Where each parameter's powers are counted from; empty for zero, as in the paper.
    """

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
    """How the basis is searched.

    Attributes:
        smallest: Relative norm below which a block counts as zero.
        passes: Passes from equal weights to that norm.
    """

    smallest: float = field(default=3e-3, metadata={"description": "Relative norm of a block that is none.", "gt": 0})
    passes: int = field(default=12, metadata={"description": "Passes of the search.", "ge": 1})


@dataclass(frozen=True)
class SparsityOptions:
    """When blocks are dropped and when the penalised fit ends.

    Attributes:
        epsilon: Relative norm at which a block's price bends from a count to its size (eq. 13).
        zero: Relative norm below which a block has vanished.
        reweightings: Times the prices are renewed, at most.
        settled: Change of any block's relative norm, over itself plus epsilon, at which they are not renewed again.
        tolerance: Relative decrease of the penalised cost at which a descent ends.
        step_limit: Cone programs of one descent, at most.
    """

    epsilon: float = field(default=1e-3, metadata={"description": "Relative norm of a block that counts.", "gt": 0})
    zero: float = field(default=1e-5, metadata={"description": "Relative norm of a block that is gone.", "gt": 0})
    reweightings: int = field(default=10, metadata={"description": "Renewals of the weights at most.", "ge": 1})
    settled: float = field(default=1e-2, metadata={"description": "Change that ends the renewals.", "gt": 0})
    tolerance: float = field(default=1e-5, metadata={"description": "Decrease that ends a descent.", "gt": 0})
    step_limit: int = field(default=30, metadata={"description": "Steps of one descent at most.", "ge": 1})


@dataclass(frozen=True)
class PathOptions:
    """Which prices are tried and how one is chosen.

    Attributes:
        count: Prices.
        smallest: Least price of a block, in mean squared errors of one element of a response.
        largest: Greatest price.
        allowance: How much more than the least a model's error on the validation data may be, relative, where it has
            fewer blocks.
    """

    count: int = field(default=10, metadata={"description": "Prices along the path.", "ge": 2})
    smallest: float = field(default=1.0, metadata={"description": "Least price, in mean squared errors.", "gt": 0})
    largest: float = field(default=1e4, metadata={"description": "Greatest price, in mean squared errors.", "gt": 0})
    allowance: float = field(default=0.05, metadata={"description": "Excess allowed for sparsity.", "ge": 0})


@dataclass(frozen=True)
class LpvOptions:
    """Options of a fit.

    Attributes:
        order: States of the model, integrators not counted.
        integrators: How often each output integrates; empty for not at all.
        weighted: Weights 1/sigma^2, or all elements alike (eq. 7).
        weight_window: Lines over which variances are averaged for the weights; intervals take them as they are.
        sparse_basis: How the states' basis is searched.
        sparsity: The penalised fits.
        path: Prices and the choice.
    """

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

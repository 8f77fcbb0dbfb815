"""Options of a rigid fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from robid.fit.rigid.base import BaseOptions
from robid.fit.rigid.consistency import ConsistencyOptions
from robid.fit.rigid.huber import HuberOptions
from robid.fit.rigid.instruments import InstrumentOptions
from robid.fit.rigid.preprocessing import PreprocessingOptions
from robid.fit.rigid.verdict import VerdictOptions
from robid.robot.regressor.options import RigidOptions

EstimatorName = Literal["ordinary", "weighted", "huber", "instruments"]


@dataclass(frozen=True)
class RigidFitOptions:
    """How rigid dynamics and friction are estimated from records."""

    model: RigidOptions = field(
        default_factory=RigidOptions, metadata={"description": "What the model has beside its links."}
    )
    filters: PreprocessingOptions = field(
        default_factory=PreprocessingOptions, metadata={"description": "Filters of positions, torques and columns."}
    )
    estimator: EstimatorName = field(
        default="weighted",
        metadata={
            "description": "Whose values and intervals are the result: least squares, plain or weighted per joint,"
            " Huber's estimator, or instrumental variables; the others are shown beside it."
        },
    )
    instruments: Literal["auto", "none"] = field(
        default="auto",
        metadata={
            "description": "Whether the model is simulated in the robot's loop as instrument: where controller and"
            " position commands are known (`auto`), or never."
        },
    )
    huber: HuberOptions = field(default_factory=HuberOptions, metadata={"description": "Huber's estimator."})
    sweep: tuple[float, ...] = field(
        default=(), metadata={"description": "Further bends of Huber's estimator, to be shown beside it."}
    )
    convergence: InstrumentOptions = field(
        default_factory=InstrumentOptions, metadata={"description": "Convergence of the instrumental variables."}
    )
    base: BaseOptions = field(default_factory=BaseOptions, metadata={"description": "How base parameters are found."})
    physical: bool = field(
        default=True,
        metadata={
            "description": "Whether the standard parameters of real bodies nearest to the robot file's are found, with"
            " the estimated base parameters; they are what is exported and handed on."
        },
    )
    consistency: ConsistencyOptions = field(
        default_factory=ConsistencyOptions, metadata={"description": "How bodies are made real."}
    )
    verdict: VerdictOptions = field(
        default_factory=VerdictOptions, metadata={"description": "When the verdict speaks against least squares."}
    )
    confidence: float = field(default=0.95, metadata={"description": "Level of the intervals.", "gt": 0, "lt": 1})
    identifiable_relative_std: float = field(
        default=0.2,
        metadata={
            "description": "Predicted relative standard deviation up to which a parameter counts as identifiable.",
            "gt": 0,
        },
    )

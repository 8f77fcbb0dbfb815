"""A choice of configurations in numbers, for programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, Meaning
from robid.design.configurations.information import ConfigurationDesign
from robid.report.design import joint_units, next_best
from robid.signals.quantities import readable


@dataclass(frozen=True)
class ChosenNumbers:
    """A chosen configuration."""

    candidate: Annotated[int, Meaning("Number of the candidate, from 1.")]
    positions: Annotated[tuple[float, ...], Meaning("Its joints' positions on the arm side, in `units`.")]
    units: Annotated[tuple[str, ...], Meaning("Unit of each, as `deg`.")]
    visits: Annotated[int, Meaning("Experiments in it.")]
    weight: Annotated[float, Meaning("Its optimal weight.")]
    cost_s: Annotated[float | None, Meaning("Time of one visit; null where all cost the same [s].")]


@dataclass(frozen=True)
class NextNumbers:
    """A candidate whose visit would add much."""

    candidate: Annotated[int, Meaning("Its number, from 1.")]
    gain: Annotated[
        float,
        Meaning(
            "What one more experiment adds to log det of the information, or takes off predictions' mean square error."
        ),
    ]
    chosen: Annotated[bool, Meaning("Whether it is among the chosen ones.")]


@dataclass(frozen=True)
class WayNumbers:
    """What one way to choose as many configurations gives."""

    way: Annotated[str, Meaning("A criterion, or `random`, `random_best`, `random_worst`: median, best, worst tenth.")]
    relative_std: Annotated[float, Meaning("Median of the parameters' relative deviations.")]
    worst_relative_std: Annotated[float, Meaning("The largest of them.")]
    prediction_error: Annotated[float, Meaning("Expected relative error of predictions, root mean square.")]
    noise_error: Annotated[float, Meaning("The part that noise and what differs between configurations have.")]
    bias_error: Annotated[float, Meaning("The part that what the model lacks has.")]
    resonance_error: Annotated[
        float | None, Meaning("Expected relative error of predicted resonances; null where the band has none.")
    ]


@dataclass(frozen=True)
class StabilityNumbers:
    """What other data or parameters choose."""

    by: Annotated[str, Meaning("`realizations` (each half of them) or `draws` (each one alone).")]
    kept: Annotated[tuple[float, ...], Meaning("Share of the choice that each chooses too.")]
    efficiency: Annotated[tuple[float, ...], Meaning("Efficiency of that choice by what it did not use.")]


@dataclass(frozen=True)
class DesignNumbers:
    """A choice of configurations and what it promises."""

    criterion: Annotated[str, Meaning("What it maximises, as `d`.")]
    predict: Annotated[str, Meaning("What the model is to predict, as `response`.")]
    gap: Annotated[float, Meaning("Certificate: no weights are worth more than 1 + `gap` times as much.")]
    efficiency: Annotated[float, Meaning("Worth of the choice over the bound on any weights.")]
    choice_efficiency: Annotated[float, Meaning("The same over the bound on as many different candidates.")]
    rounding_loss: Annotated[float, Meaning("Share of the worth that whole numbers cost.")]
    chosen: Annotated[tuple[ChosenNumbers, ...], Meaning("The chosen configurations, in the order to measure.")]
    weights: Annotated[dict[str, float], Meaning("Optimal weights by number of the candidate, those above 0.")]
    predicted_relative_std: Annotated[
        dict[str, float], Meaning("Relative standard deviation that the choice promises, by parameter.")
    ]
    between_relative_std: Annotated[
        dict[str, float] | None, Meaning("Deviation between configurations that was allowed for, by parameter.")
    ]
    next_best: Annotated[tuple[NextNumbers, ...], Meaning("Candidates whose visit adds most, the best first.")]
    alternatives: Annotated[
        tuple[WayNumbers, ...], Meaning("What as many configurations give by each criterion and at random.")
    ]
    stability: Annotated[StabilityNumbers | None, Meaning("How much of it would come out the same.")]


def design_numbers(design: ConfigurationDesign) -> DesignNumbers:
    """Returns a choice in numbers, angles in degrees."""
    stability, between = design.stability, design.between_relative_std
    told = None
    if stability is not None:
        told = StabilityNumbers(stability.source, tuple(stability.kept.tolist()), tuple(stability.efficiency.tolist()))
    return DesignNumbers(
        criterion=design.criterion,
        predict=design.predict,
        gap=design.gap,
        efficiency=design.efficiency,
        choice_efficiency=design.choice_efficiency,
        rounding_loss=design.rounding_loss,
        chosen=tuple(_chosen(design, int(index)) for index in design.chosen),
        weights={str(index + 1): float(design.weights[index]) for index in np.flatnonzero(design.weights)},
        predicted_relative_std=_by_parameter(design, design.predicted_relative_std),
        between_relative_std=None if between is None else _by_parameter(design, between),
        next_best=tuple(
            NextNumbers(index + 1, float(design.gain[index]), index in design.chosen) for index in next_best(design)
        ),
        alternatives=tuple(WayNumbers(**vars(each)) for each in design.alternatives),
        stability=told,
    )


def _chosen(design: ConfigurationDesign, index: int) -> ChosenNumbers:
    return ChosenNumbers(
        candidate=index + 1,
        positions=tuple(readable(design.configurations[index], design.joint_units).tolist()),
        units=joint_units(design),
        visits=int(design.counts[index]),
        weight=float(design.weights[index]),
        cost_s=None if design.cost_s is None else float(design.cost_s[index]),
    )


def _by_parameter(design: ConfigurationDesign, values: FloatArray) -> dict[str, float]:
    return dict(zip(design.parameter_names, values.tolist(), strict=True))

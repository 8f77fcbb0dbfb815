"""A design's choice, and what as many configurations would give by the other criteria and at random."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import get_args

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.comparison import Alternative, compare
from robid.design.configurations.for_prediction import design_for_prediction
from robid.design.configurations.information import ConfigurationDesign, design_configurations, promised_deviations
from robid.design.configurations.options import CriterionName, DesignOptions
from robid.design.configurations.prediction import ExpectedError, PredictionParts
from robid.pipeline.design_information import CandidateInformation
from robid.pipeline.design_outputs import predicted_there, with_resonances
from robid.pipeline.design_prediction import gather_prediction
from robid.pipeline.design_tasks import design_tasks
from robid.pipeline.stage import Job

_COMPARED = 100
"""Candidates among which other choices are made, to be compared with."""


def choose(
    found: CandidateInformation, options: DesignOptions, cost: FloatArray | None, parts: PredictionParts | None
) -> ConfigurationDesign:
    """Chooses by any criterion; what candidates add to a fit is given where predictions decide."""
    known = found.prior, cost, found.between
    about = found.matrices, found.configurations, found.names, options
    if parts is not None:
        return design_for_prediction(parts, *about, prior=known[0], cost=known[1], between=known[2])
    return design_configurations(*about, prior=known[0], cost=known[1], between=known[2], fitted=found.fitted)


def alternatives(
    job: Job, found: CandidateInformation, choice: ConfigurationDesign, parts: PredictionParts | None
) -> tuple[Alternative, ...]:
    """What as many configurations would give by each criterion and at random, among some hundred candidates."""
    size, options = len(choice.configurations), job.loaded.experiment.designs[job.owner].options()
    some = np.arange(size)
    if size > _COMPARED:
        others = np.random.default_rng(options.seed).permutation(np.setdiff1d(some, choice.chosen))
        some = np.sort(np.concatenate([choice.chosen, others[: max(_COMPARED - choice.chosen.size, 0)]]))
    if parts is None:
        own = gather_prediction(job, design_tasks(job, some), found.between)
        own = predicted_there(job, own, found.between, found.configurations)
    else:
        own = parts.take(some)
    less, cost = found.take(some), None if choice.cost_s is None else choice.cost_s[some]

    def by(criterion: CriterionName) -> IntArray:
        if criterion == choice.criterion:
            return choice.counts[some]
        asked = replace(options, criterion=criterion)
        return choose(less, asked, cost, own if criterion == "prediction" else None).counts

    ways = {name: partial(by, name) for name in get_args(CriterionName)}
    promised = promised_deviations(less.matrices, found.prior, found.between)
    known, resonances = own.known(found.prior), with_resonances(job, own, found.configurations)
    beside = None if resonances is None else ExpectedError(resonances, known)
    return compare(ways, ExpectedError(own, known), options, promised, beside)

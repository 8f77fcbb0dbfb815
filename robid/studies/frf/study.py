"""The study of estimators: many small groups of realizations against the best linear approximation of all."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.artifact import Dataset
from robid.artifacts.kinds import EXCITATION
from robid.artifacts.store import read_header
from robid.errors import DataError
from robid.frf.laws import combine_laws
from robid.frf.options import IDENTIFYING, EstimateOptions
from robid.frf.silent import identify_laws, start_laws
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.robot.friction import TorqueLaw
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings
from robid.signals.quantities import units_text
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import SimulateOptions
from robid.studies.settings.study import FrfStudy, choices
from robid.studies.simulated import Estimator, make_estimator, played, simulate_options, simulation_settings, threads_of
from robid.studies.study import Content, Earlier, Task, study_of

_Outcome: TypeAlias = tuple[ComplexArray, FloatArray, str]
"""Response and variance of one estimate, NaN where it was refused, and why."""


def compared(study: FrfStudy, campaign: Campaign) -> list[EstimateOptions]:
    """Returns what is estimated from each group: every estimator, then every other compensation.

    Estimators are compared under the campaign's compensation, compensations with the campaign's estimator.
    """
    own = campaign.estimate
    estimators = dict.fromkeys([own.estimator, *(study.estimators or choices("estimator"))])
    others = [name for name in compensations(study, campaign) if name != own.compensation_kind]
    chosen = [replace(own, estimator=name) for name in estimators]  # type: ignore[arg-type]
    return chosen + [replace(own, compensation=name) for name in others]  # type: ignore[arg-type]


def compensations(study: FrfStudy, campaign: Campaign) -> list[str]:
    """Returns the compensations to compare, the campaign's own among them."""
    named = study.compensations or choices("compensation")
    return list(dict.fromkeys([*named, campaign.estimate.compensation_kind]))


def campaign_of(loaded: LoadedExperiment) -> tuple[FrfStudy, Campaign, SimulateOptions]:
    """Returns the study, its campaign, and how that is simulated."""
    study = study_of(loaded, FrfStudy)
    campaign = loaded.experiment.campaigns[study.campaign]
    return study, campaign, simulate_options(campaign)


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    return (f"{campaign_of(loaded)[0].campaign}/excitation.h5",)


def tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each configuration and chunk of realizations."""
    study, campaign, options = campaign_of(run.loaded)
    path, excitation = run.path(needs(run.loaded)[0]), played(run, study.campaign)
    whole = simulated_experiment(run.loaded, campaign, options, excitation)
    decides = _decides(run.loaded, read_header(path, EXCITATION).content_sha256)
    small = tuple(make_estimator(run.loaded, campaign, each) for each in compared(study, campaign))
    large = tuple(make_estimator(run.loaded, campaign, each) for each in reference_options(study, campaign))
    length = study.group * study.groups_per_task
    found = []
    for index, configuration in enumerate(excitation.configurations):
        for number, start in enumerate(range(0, campaign.realizations, length)):
            seed = int(np.random.SeedSequence([options.seed, number]).generate_state(1)[0])
            part = replace(
                whole, reference=whole.reference[start : start + length], options=replace(options, seed=seed)
            )
            arguments = part, configuration, index, study.group, small, large, threads_of(run)
            place = {"configuration": index, "chunk": number}
            found.append(Task(f"configuration_{index + 1}_chunk_{number + 1}", {**decides, **place}, arguments))
    return found


def reference_options(study: FrfStudy, campaign: Campaign) -> list[EstimateOptions]:
    """Returns how the best linear approximation is estimated, once per compensation."""
    own = replace(campaign.estimate, estimator=study.reference_estimator)  # type: ignore[arg-type]
    return [replace(own, compensation=name) for name in compensations(study, campaign)]  # type: ignore[arg-type]


def _decides(loaded: LoadedExperiment, excitation: str) -> dict[str, Any]:
    study, campaign, _ = campaign_of(loaded)
    return {
        "excitation": excitation,
        **simulation_settings(loaded, campaign),
        "group": study.group,
        "groups_per_task": study.groups_per_task,
        "estimates": plain_settings(compared(study, campaign)),
        "references": plain_settings(reference_options(study, campaign)),
    }


def estimate_chunk(
    experiment: SimulatedExperiment,
    configuration: FloatArray,
    index: int,
    group: int,
    small_estimators: tuple[Estimator, ...],
    whole_estimators: tuple[Estimator, ...],
    threads: int,
) -> Content:
    """Simulates some realizations in one configuration, and estimates from each of their groups and from all."""
    record = simulate(experiment, configuration, index, threads)
    n_real = record.inputs.shape[1]
    groups = [record.realizations(group, at) for at in range(0, n_real, group)]
    identified = _identified(groups[0], (*small_estimators, *whole_estimators))
    small = [[_estimate(part, each, identified) for part in groups] for each in small_estimators]
    whole = [_estimate(record, each, identified) for each in whole_estimators]
    element = ("frequency", "output", "input")
    unit = f"rad/(s^2 {units_text(record.input_channels)})"
    refused = [next((reason for *_, reason in row if reason), "") for row in (*small, whole)]
    response, variance = (np.array([[one[at] for one in row] for row in small]) for at in (0, 1))
    datasets = {
        "configuration": Dataset(np.array(index), "1", ()),
        "angles": Dataset(configuration, "rad", ("joint",)),
        "frequency_hz": Dataset(record.frequency_hz, "Hz", ("frequency",)),
        "response": Dataset(response, unit, ("estimate", "group", *element)),
        "variance": Dataset(variance, f"({unit})^2", ("estimate", "group", *element)),
        "whole": Dataset(np.array([one[0] for one in whole]), unit, ("compensation", *element)),
        "realizations": Dataset(np.array(n_real), "1", ()),
        "refusals": Dataset(np.array(refused, dtype=str), "1", ("reason",), "First refusal of each; last: of whole"),
    }
    return Content(datasets)


def _identified(record: Record, estimators: tuple[Estimator, ...]) -> tuple[TorqueLaw, ...] | str | None:
    """Laws that the silent lines of a group show, why there are none, or None where nobody asks."""
    asking = [each for each in estimators if each.options.compensation_kind in IDENTIFYING]
    if not asking or asking[0].laws is None:
        return None
    stated, delay = asking[0].laws, asking[0].delay_s
    try:
        start = start_laws(record, stated, delay)
        return combine_laws([identify_laws(record, start, delay)], start, stated, record.input_names)[0]
    except DataError as error:
        return error.what


def _estimate(record: Record, estimator: Estimator, identified: tuple[TorqueLaw, ...] | str | None) -> _Outcome:
    """Estimates; a refusal becomes NaN with its reason."""
    laws = identified if estimator.options.compensation in IDENTIFYING else estimator.laws
    if isinstance(laws, str) and estimator.options.compensation == "auto":
        laws = estimator.laws
    if isinstance(laws, str):
        return _refused(record, laws)
    try:
        frf = replace(estimator, laws=laws).estimate(record)
    except DataError as error:
        return _refused(record, error.what)
    return frf.response[0], frf.element_variance()[0], ""


def _refused(record: Record, reason: str) -> _Outcome:
    shape = (len(record.excited_lines), len(record.output_names), len(record.input_names))
    return np.full(shape, complex(np.nan, np.nan)), np.full(shape, np.nan), reason

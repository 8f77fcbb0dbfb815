"""What each stage reads and writes for one campaign, design or fit, and what its output says of itself.

The settings in a plan are those that decide the stage's result, and no others: an output is fresh as long as these and
the content of its inputs are what they were.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.kinds import DESIGN, FILES
from robid.artifacts.results import MODEL, VALIDATION, read_grade
from robid.artifacts.store import read_attributes
from robid.artifacts.truth import check_vouched
from robid.design.configurations.options import InformationOptions
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.settings import elastic_fit
from robid.models.family import family_of
from robid.pipeline.stage import Plan, Stage, measured_campaigns
from robid.report.numbers import percent
from robid.results.grade import Grade
from robid.settings.checks.configurations import configuration_count
from robid.settings.checks.experiment import sampling_period_s
from robid.settings.experiment import Campaign, Design, Experiment, heaviest
from robid.settings.fits import FitSettings, Read
from robid.settings.load import LoadedExperiment
from robid.settings.robot import assumed_names
from robid.settings.robot_parts import (
    Part,
    delay_s,
    input_count,
    line_settings,
    log_sampling_settings,
    plain_settings,
    require_controller,
    robot_settings,
)
from robid.settings.sources import Acquire, ResponseSource
from robid.simulate.options import STEP_LIMITS

_WIDE_GAP = 0.01
_READ_OF_FIT = ("estimator", "weights", "correct_torques", "free", "fixed", "prior_decades")
_READ_OF_EXCITATION = ("excitation", "realizations", "experiments", "periods", "payload_kg")
_BYTES_PER_SAMPLE = 4


def design_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans the choice of configurations."""
    design = loaded.experiment.designs[owner]
    campaign = loaded.experiment.campaigns[design.campaign]
    section = f"campaigns.{design.campaign}"
    cost: tuple[Part, ...] = ("motor_limits",) if design.cost == "travel" else ()
    predicts = design.criterion == "prediction"
    settings = {
        f"designs.{owner}": loaded.plain["designs"][owner],
        f"{section}.payload_kg": campaign.payload_kg,
        # What a file may be off by decides how well a fit would predict, which is stated of every choice.
        **robot_settings(loaded, "mechanics", "range", "timing", "inertia_std", "doubts", *cost),
    }
    if design.cost == "travel":
        settings[f"{section}.visit_s"] = visit_s(loaded, campaign)
    if predicts and design.predict_at is not None:
        configurations = loaded.plain["campaigns"][design.predict_at]["configurations"]
        settings[f"campaigns.{design.predict_at}.configurations"] = configurations
    inputs = {} if design.prior is None else {"model": f"fits/{design.prior}/model.h5"}
    if design.between is not None:
        inputs["between"] = f"fits/{design.between}/model.h5"
    if design.information == "measured":
        settings |= {f"{section}.pooled_lines": campaign.estimate.pooled_lines, "delay_s": delay_s(loaded, campaign)}
        inputs["frf"] = f"{design.campaign}/frf.h5"
        if (fit := fit_options(loaded.experiment, design)) is not None:
            settings[f"designs.{owner}.for"] = {name: plain_settings(getattr(fit, name)) for name in _READ_OF_FIT}
    else:
        settings |= {
            f"{section}.configurations": loaded.plain["campaigns"][design.campaign]["configurations"],
            f"{section}.excitation": line_settings(campaign),
            **log_sampling_settings(design.campaign, campaign),
        }
        inputs |= design_inputs(campaign)
    return Plan((f"designs/{owner}.h5",), settings, inputs)


def fit_options(experiment: Experiment, design: Design) -> ElasticOptions | None:
    """Returns the options of the fit whose weights a design is for: the named one, else one by user weights."""
    if design.weights.mean != "fit":
        return None
    if design.fit is not None:
        return elastic_fit(experiment, design.fit).options()
    own = design.weights
    return ElasticOptions(weights=Weights("user", off_diagonal=own.off_diagonal, low_cut_hz=own.low_cut_hz))


def about_options(experiment: Experiment, design: Design) -> InformationOptions:
    """Returns which information a design is made by, what is estimated along spelled out: as in the fit it names."""
    about, fit = design.about(), None if design.fit is None else elastic_fit(experiment, design.fit)
    along = about.along(None if fit is None else fit.kinds)
    held = () if fit is None or about.nuisance is not None else fit.fixed
    fixed = (*about.fixed, *(name for name in held if name.rpartition(".")[2] in along and name not in about.fixed))
    return replace(about, nuisance=along, fixed=fixed)


def visit_s(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Returns the time that a campaign's experiments in one configuration take [s]."""
    transient = next(iter(transient_periods(campaign).values()))
    experiments = campaign.realizations * campaign.block_size(len(loaded.robot.joints))
    return experiments * (transient + campaign.periods) * campaign.excitation.period_s


def design_inputs(campaign: Campaign) -> dict[str, str]:
    """Returns the designs that a campaign's configurations come from, by name of input."""
    names = campaign.designs
    if len(names) == 1:
        return {"design": f"designs/{names[0]}.h5"}
    return {f"design {name}": f"designs/{name}.h5" for name in names}


def design_problem(output: Path) -> str:
    """Says that a design's weights are far from optimal."""
    gap = read_attributes(output, DESIGN)["gap"]
    if gap <= _WIDE_GAP:
        return ""
    return (
        f"no weights were found that are optimal within {percent(_WIDE_GAP)} (gap {percent(gap)}): raise `iterations`"
    )


def excitation_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans the design of an excitation."""
    campaign = loaded.experiment.campaigns[owner]
    section, plain = f"campaigns.{owner}", loaded.plain["campaigns"][owner]
    settings = {f"{section}.configurations": plain["configurations"]}
    if played_by_others(campaign) is None:
        settings |= {f"{section}.{key}": plain[key] for key in _READ_OF_EXCITATION}
        settings |= {f"{section}.source.{key}": value for key, value in transient_periods(campaign).items()}
        settings |= robot_settings(loaded, "mechanics", "range", "motor_limits", "controller", *_balances(loaded))
        if campaign.moves_poses:
            settings |= robot_settings(loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "pose")
        elif campaign.is_trajectory:
            settings |= robot_settings(loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "controller")
    else:
        settings[f"{section}.excitation"] = line_settings(campaign)
        settings |= log_sampling_settings(owner, campaign)
        settings |= robot_settings(loaded, "range")
    return Plan((f"{owner}/excitation.h5",), settings, design_inputs(campaign))


def _balances(loaded: LoadedExperiment) -> tuple[Part, ...]:
    """What holds a robot's counterbalances; nothing where it has none, so that what was made of such robots stays."""
    return ("rigid",) if any(joint.counterbalance is not None for joint in loaded.robot.joints) else ()


def played_by_others(campaign: Campaign) -> Acquire | None:
    """Returns the logs of a campaign whose excitation is not designed here: arbitrary, or without references."""
    acquire = None if campaign.source is None else campaign.source.acquire
    designed = acquire is None or (acquire.references and not campaign.is_arbitrary)
    return None if designed else acquire


def transient_periods(campaign: Campaign) -> dict[str, int]:
    """Periods before those that count, by the name of the setting below `source`."""
    source = campaign.source
    if source is not None and source.acquire is not None:
        return {"acquire.drop_periods": source.acquire.drop_periods}
    simulated = None if source is None else source.simulate
    return {"simulate.transient_periods": 0 if simulated is None else simulated.transient_periods}


def record_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans the simulation of a campaign or the import of its logs."""
    campaign = loaded.experiment.campaigns[owner]
    section = f"campaigns.{owner}"
    settings: dict[str, Any] = {f"{section}.periods": campaign.periods}
    settings[f"{section}.source"] = loaded.plain["campaigns"][owner]["source"]
    if campaign.source is not None and campaign.source.response is not None:
        return _files_plan(loaded, campaign, owner, campaign.source.response)
    record = f"{owner}/record.h5"
    inputs = {} if campaign.is_one_shot else {"excitation": f"{owner}/excitation.h5"}
    if campaign.source is not None and campaign.source.acquire is not None:
        settings |= {f"{section}.{key}": getattr(campaign, key) for key in ("realizations", "experiments")}
        # The excitation's file holds the lines, and not whether they are candidates, or those of any signal.
        settings |= {f"{section}.excitation.lines": "found"} if campaign.finds_lines else {}
        settings |= {f"{section}.excitation.signal": "arbitrary"} if campaign.is_arbitrary else {}
        return Plan((record,), settings, inputs, log_files(loaded, campaign, campaign.source.acquire))
    settings[f"{section}.payload_kg"] = campaign.payload_kg
    settings[f"{section}.outputs"] = loaded.plain["campaigns"][owner]["outputs"]
    simulated = None if campaign.source is None else campaign.source.simulate
    if simulated is None or simulated.steps_per_sample is None:
        settings["steps_per_sample"] = dict(STEP_LIMITS)
    recorded: Part = "pose" if campaign.moves_poses else "sensors"
    known: tuple[Part, ...] = ("mechanics", "motor_limits", "friction", "controller", recorded)
    settings |= robot_settings(loaded, *known, *_balances(loaded))
    return Plan((record, f"{owner}/truth.json"), settings, inputs, needed_bytes=_needed_bytes(loaded, campaign))


def _files_plan(loaded: LoadedExperiment, campaign: Campaign, owner: str, source: ResponseSource) -> Plan:
    """Plans the check of files of responses; their configurations decide what is read."""
    section = f"campaigns.{owner}"
    plain = loaded.plain["campaigns"][owner]
    settings = {f"{section}.{key}": plain[key] for key in ("source", "configurations", "estimate")}
    files = response_files(loaded, campaign, source)
    return Plan((f"{owner}/files.h5",), settings, design_inputs(campaign), files, kind=FILES)


def response_files(loaded: LoadedExperiment, campaign: Campaign, source: ResponseSource) -> dict[str, Path]:
    """Returns the path of every file of responses by a name that says which it is."""
    count = configuration_count(loaded.experiment, campaign) or 1
    found: dict[str, Path] = {}
    for index in range(count if source.is_numbered else 1):
        for key, path in source.paths(loaded.path.parent, index).items():
            of = f" of configuration {index + 1}" if source.is_numbered else ""
            found[f"response file{of}" if key is None else f"response file{of}, {path.name}"] = path
    return found


def _needed_bytes(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Inputs and outputs of all samples, once in the parts and once merged."""
    n_input = input_count(campaign, loaded.robot)
    period_s = sampling_period_s(campaign, loaded.robot) or require_controller(loaded).sampling_period_s
    n_channel = 2 * n_input + len(campaign.outputs) - 1
    blocks = (configuration_count(loaded.experiment, campaign) or 0) * campaign.realizations
    experiments = blocks * campaign.block_size(n_input)
    samples = experiments * campaign.periods * campaign.excitation.period_s / period_s
    return 2 * _BYTES_PER_SAMPLE * samples * n_channel


def log_files(loaded: LoadedExperiment, campaign: Campaign, acquire: Acquire) -> dict[str, Path]:
    """Returns the path of every log by a name that says which it is; `log` where there is only one."""
    counts = (
        configuration_count(loaded.experiment, campaign) or 0,
        campaign.realizations,
        experiment_count(campaign, acquire),
    )
    found: dict[str, Path] = {}
    for place in np.ndindex(*counts):
        c, r, e = (index + 1 for index in place)
        name = "log" if np.prod(counts) == 1 else f"log of configuration {c}, realization {r}, experiment {e}"
        found[name] = acquire.log_path(loaded.path.parent, *place)
        for further in acquire.further_paths(loaded.path.parent, *place).values():
            found[f"{name}, {further.name}"] = further
    return found


def experiment_count(campaign: Campaign, acquire: Acquire) -> int:
    """Returns the number of logged experiments of each block: as many as inputs unless the campaign says less.

    Shots that do not repeat are one unless the campaign says more.
    """
    return campaign.experiments or 1 if acquire.one_shot else campaign.block_size(len(acquire.inputs))


def truth_is_not_vouched(outputs: Sequence[Path]) -> str:
    """Refuses a truth that is not the record's; an imported record has none, and an older one says nothing of it."""
    if all(check_vouched(truth, outputs[0]) for truth in outputs[1:]):
        return ""
    return "the record is of an earlier version, which does not say its truth"


def response_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans the estimate of frequency responses."""
    campaign = loaded.experiment.campaigns[owner]
    settings: dict[str, Any] = {f"campaigns.{owner}.estimate": loaded.plain["campaigns"][owner]["estimate"]}
    if campaign.source is not None and campaign.source.response is not None:
        settings[f"campaigns.{owner}.source"] = loaded.plain["campaigns"][owner]["source"]
        files = response_files(loaded, campaign, campaign.source.response)
        return Plan((f"{owner}/frf.h5",), settings, {"files": f"{owner}/files.h5"}, files)
    if campaign.estimate.compensation != "none":
        settings |= {"delay_s": delay_s(loaded, campaign), **robot_settings(loaded, "friction", "friction_std")}
    inputs = {"record": f"{owner}/record.h5"}
    if campaign.estimate.friction_fit is not None:
        inputs["friction"] = f"fits/{campaign.estimate.friction_fit}/model.h5"
    return Plan((f"{owner}/frf.h5",), settings, inputs)


def nothing_reads_response(loaded: LoadedExperiment, owner: str) -> bool:
    """Whether fits read the campaign's record, and nothing reads its response."""
    experiment = loaded.experiment
    reads = {
        kind
        for name, fit in experiment.fits.items()
        if owner in (*fit.campaigns, fit.validate_on)
        for kind in family_of(loaded, name).reads
    }
    designs = [design for design in experiment.designs.values() if design.information == "measured"]
    return "record" in reads and "frf" not in reads and owner not in [design.campaign for design in designs]


def fit_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans a fit."""
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    plain = {key: value for key, value in loaded.plain["fits"][owner].items() if key != "validate_on"}
    settings = {f"fits.{owner}": plain, **family.decides(loaded, fit.campaign), **_payloads(loaded, fit)}
    inputs = {**data_inputs(family.reads, fit.campaigns), **taken_inputs(fit)}
    return Plan((f"fits/{owner}/model.h5",), settings, inputs)


def taken_inputs(fit: FitSettings) -> dict[str, str]:
    """Returns where the models of the fits lie that a fit takes something of, by what it takes."""
    return {what: f"fits/{name}/model.h5" for what, name in fit.takes.items()}


def _payloads(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, float | None]:
    """Payloads of a fit's campaigns, where they may differ."""
    if not fit.takes_payloads:
        return {}
    return {f"campaigns.{name}.payload_kg": loaded.experiment.campaigns[name].payload_kg for name in fit.campaigns}


def data_inputs(reads: Sequence[Read], campaigns: Sequence[str]) -> dict[str, str]:
    """Returns where the responses and records of campaigns lie; the first one's name is its kind."""
    return {
        f"{kind}_{name}" if index else kind: f"{name}/{kind}.h5"
        for kind in reads
        for index, name in enumerate(campaigns)
    }


def fit_problem(output: Path) -> str:
    """Says that a fit has not converged, and what to do."""
    attributes = read_attributes(output, MODEL)
    status, advice = (attributes[f"estimate/{name}"] for name in ("status", "advice"))
    return "" if status == "converged" else f"the fit has not converged ({status}): {advice}"


def fit_grade(loaded: LoadedExperiment, owner: str, output: Path) -> Grade | None:
    """Reads how far to trust a model; where a fit is validated, the validation owns the grade."""
    return read_grade(output, MODEL) if loaded.experiment.fits[owner].validate_on is None else None


def validation_grade(_loaded: LoadedExperiment, _owner: str, output: Path) -> Grade:
    """Reads the grade that a validation holds."""
    return read_grade(output, VALIDATION)


def validation_plan(loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans a validation."""
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    campaign = fit.validate_on or fit.campaign
    settings = {f"fits.{owner}": loaded.plain["fits"][owner], **family.decides(loaded, fit.campaign)}
    settings |= _payloads(loaded, fit)
    settings |= {f"campaigns.{campaign}.payload_kg": loaded.experiment.campaigns[campaign].payload_kg}
    # Records are read whatever the family reads: samples of the fit are looked for in the new one.
    every = {**{f"seen_{name}": name for name in fit.campaigns}, "new_record": campaign}
    of = loaded.experiment.campaigns
    seen = {key: f"{name}/{'files' if of[name].is_response else 'record'}.h5" for key, name in every.items()}
    inputs = {"model": f"fits/{owner}/model.h5", **data_inputs(family.reads, (campaign,)), **truth_input(loaded, fit)}
    return Plan((f"fits/{owner}/validation.h5",), settings, inputs | taken_inputs(fit) | seen)


def truth_input(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, str]:
    """Returns where the truth of a fit's campaign and its record lie; a measured robot has none."""
    campaign = heaviest(loaded.experiment, fit, loaded.robot)
    source = loaded.experiment.campaigns[campaign].source
    simulated = source is not None and source.simulate is not None
    return {"truth": f"{campaign}/truth.json", "true_record": f"{campaign}/record.h5"} if simulated else {}


def report_plan(chain: Sequence[Stage], loaded: LoadedExperiment, owner: str) -> Plan:
    """Plans the page on all that a chain of stages makes."""
    experiment, robot = loaded.experiment, loaded.robot
    settings = {
        "name": owner,
        "robot.name": robot.name,
        "robot.notes": list(robot.notes),
        "robot.assumed": list(assumed_names(robot)),
        "fits": loaded.plain["fits"],
        **robot_settings(loaded, "mechanics", "range", "motor_limits", "rated_torque"),
    }
    for name in measured_campaigns(experiment):
        campaign = experiment.campaigns[name]
        settings[f"campaigns.{name}"] = {"payload_kg": campaign.payload_kg, "delay_s": delay_s(loaded, campaign)}
    inputs = {
        path: path
        for stage in chain
        for name in stage.owners(experiment)
        if not stage.on_request(loaded, name)
        for path in stage.plan(loaded, name).outputs
    }
    return Plan(("report.html", "summary.json"), settings, inputs)

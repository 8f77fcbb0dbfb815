"""What must hold across an experiment file and its robot beyond the types of the fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, islice
from typing import Any

from robid.design.excitation.options import ArbitraryOptions, PoseChirpOptions, SignalOptions, TrajectoryOptions
from robid.errors import SettingsError
from robid.later import later
from robid.settings.checks.beyond_motors import check_experiment_of_sensed, check_pose_campaign
from robid.settings.checks.campaigns import (
    check_designs,
    check_limits,
    check_truth,
    check_without_robot,
    needs_of_robot,
)
from robid.settings.checks.configurations import check_cycles, check_reachable, configuration_count, named_designs
from robid.settings.checks.logs import check_channels, check_handed_on, check_logs
from robid.settings.checks.responses import check_readers, check_response, check_response_of_robot
from robid.settings.checks.sizes import check_counts
from robid.settings.experiment import Campaign, Experiment
from robid.settings.fits import Families, FitSettings
from robid.settings.problems import MOST_PROBLEMS, Found, SettingsProblem, problem_at, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import commanded_channels
from robid.settings.yaml import Document, FieldPath

with later(__name__):
    from robid.design.excitation.lines import check_signal


@dataclass(frozen=True)
class Studies:
    """What loading a file asks of studies, which lie above: their type in a file, and what is wrong with one."""

    settings: Any
    check: Callable[[Experiment, RobotFile | None], Found]


_ARBITRARY = "S174 `arbitrary` says what logs hold: add `source: {acquire: ...}`, or choose a signal that can be played"
_FOUND = "S175 lines are `found` in logs: add `source: {acquire: ...}`, or say which lines are played"
_NO_RMS = (TrajectoryOptions, PoseChirpOptions, ArbitraryOptions)
_FOLDERS = ("designs", "fits", "tasks")


def check_experiment(
    document: Document,
    experiment: Experiment,
    robot: RobotFile | None,
    families: Families,
    studies: Studies | None = None,
) -> list[SettingsProblem]:
    """Returns everything that is wrong across an experiment; what needs the robot is left out without one."""
    if experiment.robot is None and needs_of_robot(experiment, families):
        robot = None  # it was forgotten, and what follows from that is not told
    folders = [name for name in experiment.campaigns if name in _FOLDERS]
    found: list[Iterable[tuple[FieldPath, str]]] = [
        ((("campaigns", name), f"S176 `{name}` is a folder of every run: name it otherwise") for name in folders),
        check_without_robot(experiment, families),
        check_designs(experiment, robot),
        check_cycles(experiment),
        check_handed_on(experiment),
        check_readers(experiment, families),
        () if studies is None else studies.check(experiment, robot),
    ]
    for name, campaign in experiment.campaigns.items():
        found += [_campaign(experiment, name, campaign), check_counts(experiment, name, campaign)]
        if robot is not None:
            of = _campaign_of_robot if experiment.robot is not None else _campaign_of_logs
            found.append(of(name, campaign, robot))
    for name, fit in experiment.fits.items():
        found.append(_fit(experiment, name, fit, families))
        if robot is not None:
            found.append(_fit_of_robot(experiment, name, fit, robot, families))
    if robot is not None:
        found += [check_limits(experiment, robot), check_experiment_of_sensed(experiment, robot)]
    some = islice(chain.from_iterable(found), MOST_PROBLEMS)
    return [problem_at(document, field, message) for field, message in some]


def sampling_period_s(campaign: Campaign, robot: RobotFile) -> float | None:
    """Returns the sampling period of a campaign: the log's, else the pose interface's or the controller's [s]."""
    if campaign.source is not None and campaign.source.measured is not None:
        return campaign.source.measured.sampling_period_s
    if campaign.moves_poses:
        return None if robot.pose_interface is None else robot.pose_interface.sampling_period_s
    return None if robot.controller is None else robot.controller.sampling_period_s


def output_names(campaign: Campaign, robot: RobotFile) -> tuple[str, ...]:
    """Returns the names of a campaign's outputs; a simulation measures every motor."""
    if campaign.source is not None and campaign.source.measured is not None:
        return tuple(channel.name for channel in campaign.source.measured.outputs)
    motors = tuple(joint.name for joint in robot.joints)
    return (*(commanded_channels(campaign, robot) or motors), *campaign.outputs[1:])


def input_names(campaign: Campaign, robot: RobotFile) -> tuple[str, ...]:
    """Returns the names of a campaign's inputs: those of a log, commanded channels, or every motor."""
    if campaign.source is not None and campaign.source.measured is not None:
        return tuple(channel.name for channel in campaign.source.measured.inputs)
    return commanded_channels(campaign, robot) or tuple(joint.name for joint in robot.joints)


def _unknown(kind: str, name: str, known: Mapping[str, object]) -> str:
    return f"S177 there is no {kind} `{name}`; {suggest(name, known)}"


def _campaign(experiment: Experiment, name: str, campaign: Campaign) -> Found:
    field = ("campaigns", name)
    if campaign.configurations is not None:
        for place, design in named_designs((*field, "configurations"), campaign.configurations):
            if design not in experiment.designs:
                yield place, _unknown("design", design, experiment.designs)
    elif not (campaign.is_one_shot or experiment.robot is None):
        yield (*field, "configurations"), "S178 is missing: only logs of one shot go without"
    if isinstance(campaign.excitation, TrajectoryOptions):
        if campaign.experiments is not None:
            yield (*field, "experiments"), "S179 a trajectory is one experiment in each realization: leave it out"
    elif not isinstance(campaign.excitation, PoseChirpOptions | ArbitraryOptions):
        rms = campaign.excitation.rms
        if min(rms if isinstance(rms, tuple) else (rms,), default=0.0) <= 0:
            yield (*field, "excitation", "rms"), f"S180 must be above 0 (found {rms})"
    if campaign.source is not None and campaign.source.response is not None:
        yield from check_response(field, campaign, campaign.source.response)
    elif campaign.source is None or campaign.source.acquire is None:
        if campaign.is_arbitrary or campaign.finds_lines:
            yield (*field, "excitation"), _ARBITRARY if campaign.is_arbitrary else _FOUND
    else:
        count = configuration_count(experiment, campaign)
        yield from check_logs(field, campaign, campaign.source.acquire, count)


def _campaign_of_robot(name: str, campaign: Campaign, robot: RobotFile) -> Found:
    field = ("campaigns", name)
    n_joint = len(robot.joints)
    if campaign.configurations is not None:
        yield from check_reachable((*field, "configurations"), campaign.configurations, robot)
    rms = () if isinstance(campaign.excitation, _NO_RMS) else campaign.excitation.rms
    if isinstance(rms, tuple) and rms and len(rms) != n_joint:
        message = f"S181 has {len(rms)} values for the {n_joint} motors of the robot: give one, or one for each"
        yield (*field, "excitation", "rms"), message
    acquire = None if campaign.source is None else campaign.source.acquire
    if campaign.source is not None and campaign.source.response is not None:
        yield from check_response_of_robot(field, campaign.source.response, robot)
        return
    yield from _travel((*field, "excitation", "travel"), campaign, robot)
    if not campaign.is_one_shot:
        if not (campaign.is_trajectory or campaign.moves_poses or campaign.is_arbitrary):
            yield from _experiments(field, campaign, n_joint if acquire is None else len(acquire.inputs))
        yield from _lines(field, campaign, robot)
    if campaign.payload_kg and (robot.payload is None or robot.payload.mass_kg == 0):
        yield (*field, "payload_kg"), "S182 the robot file has no payload whose inertia could be scaled to this mass"
    yield from _outputs(field, campaign, robot)
    yield from check_pose_campaign(field, campaign, robot)
    if acquire is not None:
        yield from check_channels(field, campaign, acquire, robot)
    elif campaign.source is not None and campaign.source.simulate is not None:
        if robot.controller is None:
            message = "S183 a simulation needs the robot file's `controller`, which is missing"
            yield (*field, "source", "simulate"), message
        yield from check_truth((*field, "source", "simulate"), campaign, campaign.source.simulate, robot)


def _campaign_of_logs(name: str, campaign: Campaign, robot: RobotFile) -> Found:
    field, acquire = ("campaigns", name), None if campaign.source is None else campaign.source.acquire
    if acquire is not None and not campaign.is_one_shot and not campaign.is_trajectory:
        if not campaign.is_arbitrary:
            yield from _experiments(field, campaign, len(acquire.inputs))
        yield from _lines(field, campaign, robot)


def _travel(field: FieldPath, campaign: Campaign, robot: RobotFile) -> Found:
    travel = campaign.excitation.travel if isinstance(campaign.excitation, SignalOptions) else None
    if travel is None:
        return
    joints = {joint.name: joint for joint in robot.joints}
    if travel.joint not in joints:
        yield (*field, "joint"), f"S184 there is no joint `{travel.joint}`; {suggest(travel.joint, joints)}"
        return
    slides = joints[travel.joint].slides
    wanted, other = ("amplitude_m", "amplitude_deg") if slides else ("amplitude_deg", "amplitude_m")
    if getattr(travel, other) is not None:
        yield (*field, other), f"S185 has the wrong unit for `{travel.joint}`: write `{wanted}`"


def _experiments(field: FieldPath, campaign: Campaign, n_motor: int) -> Found:
    count = n_motor if campaign.experiments is None else campaign.experiments
    if count > n_motor:
        yield (*field, "experiments"), f"S186 a block has {n_motor} experiments, one per motor: {count} are too many"
    elif count < n_motor and campaign.estimate.estimator != "local_periodic":
        message = f"S187 {count} experiments do not separate {n_motor} motors: use the estimator `local_periodic`"
        yield (*field, "estimate", "estimator"), message
    if count < n_motor and campaign.estimate.compensation == "silent_lines":
        message = f"S188 needs a block of {n_motor} experiments, not {count}: use `compensation: nominal` or `none`"
        yield (*field, "estimate", "compensation"), message


def _outputs(field: FieldPath, campaign: Campaign, robot: RobotFile) -> Found:
    if campaign.source is not None and campaign.source.acquire is not None:
        if campaign.outputs != ("motors",):
            yield (*field, "outputs"), "S189 is for simulations: what a log has stands under `source.acquire.outputs`"
        return
    if campaign.outputs[:1] != ("motors",):
        yield (*field, "outputs"), "S190 must begin with `motors`"
        return
    known = robot.output_names[len(robot.joints) :]
    for index, name in enumerate(campaign.outputs[1:], start=1):
        if name not in known:
            yield (*field, "outputs", index), f"S191 the robot has no output `{name}`; {suggest(name, known)}"
        elif name in campaign.outputs[:index]:
            yield (*field, "outputs", index), f"S192 `{name}` is there twice"


def _lines(field: FieldPath, campaign: Campaign, robot: RobotFile) -> Found:
    """Chooses the signal's lines as the design will."""
    period_s = sampling_period_s(campaign, robot)
    if period_s is None:
        return
    try:
        check_signal(campaign.excitation, period_s)
    except SettingsError as error:
        yield (*field, *error.where.split(".")), f"{error.what} {error.remedy}"


def _fit(experiment: Experiment, name: str, fit: FitSettings, families: Families) -> Found:
    field, reads = ("fits", name), families[fit.family].reads
    for key, of in (*(("from", of) for of in fit.campaigns), ("validate_on", fit.validate_on)):
        if of is None:
            continue
        campaign = experiment.campaigns.get(of)
        if campaign is None:
            yield (*field, key), _unknown("campaign", of, experiment.campaigns)
        elif campaign.source is None:
            yield (*field, key), f"S194 campaign `{of}` has no `source`, so there is no record to read"
        elif "frf" not in reads:
            continue
        elif campaign.is_one_shot:
            yield (*field, key), f"S195 campaign `{of}` is one shot, which has no frequency response to read"
        elif campaign.is_trajectory:
            yield (*field, key), f"S196 campaign `{of}` plays a trajectory, which has no frequency response to read"
        elif campaign.travels:
            yield (*field, key), f"S197 campaign `{of}` travels, so it has no frequency response to read"
    if fit.validate_on in fit.campaigns:
        message = f"S198 campaign `{fit.validate_on}` is what the fit reads: validate on another one"
        yield (*field, "validate_on"), message
    if len(set(fit.campaigns)) < len(fit.campaigns):
        yield (*field, "from"), "S199 names a campaign twice"
    used = [experiment.campaigns[name] for name in fit.campaigns if name in experiment.campaigns]
    if len({campaign.payload_kg for campaign in used}) > 1 and not fit.takes_payloads:
        yield (*field, "from"), "S200 names campaigns with different payloads, which one model cannot have"
    counts = [configuration_count(experiment, campaign) for campaign in used]
    known = len(used) == len(fit.campaigns) and None not in counts
    count = sum(each or 0 for each in counts) if known else None
    for position, index in enumerate(fit.configurations or ()):
        if count is not None and index >= count:
            message = (
                f"S201 there is no configuration {index + experiment.counts_from} of"
                f" {' and '.join(f'`{name}`' for name in fit.campaigns)}: {experiment.numbered(count)}"
            )
            yield (*field, "configurations", position), message
        if index in (fit.configurations or ())[:position]:
            number = index + experiment.counts_from
            yield (*field, "configurations", position), f"S202 configuration {number} is there twice"


def _fit_of_robot(experiment: Experiment, name: str, fit: FitSettings, robot: RobotFile, families: Families) -> Found:
    field = ("fits", name)
    for below, message in families[fit.family].problems(experiment, name, robot):
        yield (*field, *below), message
    read = [experiment.campaigns[name] for name in fit.campaigns if name in experiment.campaigns]
    pairs = [("from", name) for name in fit.campaigns[1:]] + [("validate_on", fit.validate_on or "")]
    for key, name in pairs:
        other = experiment.campaigns.get(name)
        if read and other is not None and output_names(read[0], robot) != output_names(other, robot):
            ours, theirs = ", ".join(output_names(read[0], robot)), ", ".join(output_names(other, robot))
            yield (*field, key), f"S203 `{name}` measures {theirs}, but the fit reads {ours}"

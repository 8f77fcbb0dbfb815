"""What must hold of the designs of an experiment file beyond the types of the fields."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.design.configurations.options import DesignWeights
from robid.settings.checks.configurations import configuration_count
from robid.settings.experiment import Design, Experiment
from robid.settings.fits import FitSettings
from robid.settings.parameter_names import parameter_names
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_EARLIER = ("prior", "between")
"""Settings of a design that name an earlier fit."""


def check_designs(experiment: Experiment, robot: RobotFile | None) -> _Found:
    """Yields what is wrong with the designs; what needs the robot is left out without one."""
    for name, design in experiment.designs.items():
        field: FieldPath = ("designs", name)
        yield from _candidates(field, experiment, design)
        for index, kind in enumerate(design.nuisance or ()):
            if kind in design.free:
                yield (*field, "nuisance", index), f"`{kind}` is under `free` already: name each kind once"
        for key in _EARLIER:
            earlier = getattr(design, key)
            if earlier is not None and earlier not in experiment.fits:
                yield (*field, key), f"there is no fit `{earlier}`; {suggest(earlier, experiment.fits)}"
        yield from _fit(field, experiment, design)
        if robot is not None:
            yield from _parameters(field, experiment, design, robot)


def _candidates(field: FieldPath, experiment: Experiment, design: Design) -> _Found:
    campaign = experiment.campaigns.get(design.campaign)
    if campaign is None:
        known = experiment.campaigns
        yield (*field, "campaign"), f"there is no campaign `{design.campaign}`; {suggest(design.campaign, known)}"
        return
    if campaign.is_trajectory:
        message = f"campaign `{design.campaign}` plays a trajectory, which tells nothing of springs: name another one"
        yield (*field, "campaign"), message
    if campaign.moves_poses:
        message = f"campaign `{design.campaign}` commands poses, which tells nothing of springs: name another one"
        yield (*field, "campaign"), message
    if campaign.travels:
        message = f"campaign `{design.campaign}` travels, so it has no responses to choose by: name another one"
        yield (*field, "campaign"), message
    if campaign.configurations is None and campaign.is_one_shot:
        yield (*field, "campaign"), f"campaign `{design.campaign}` is one shot without configurations to choose from"
        return
    count = configuration_count(experiment, campaign)
    if count is not None and design.count > count:
        yield (*field, "count"), f"cannot choose {design.count} of the {count} configurations of `{design.campaign}`"
    if design.information == "measured" and (campaign.source is None or campaign.is_one_shot):
        lacks = "is one shot" if campaign.is_one_shot else "has no `source`"
        message = (
            f"campaign `{design.campaign}` {lacks}, so there are no responses to read: give it one that repeats, or use"
            " `information: assumed`"
        )
        yield (*field, "information"), message
    if design.information == "assumed" and design.weights.mean == "fit":
        yield (*field, "weights", "mean"), "a fit's own weights need the responses' covariance: `information: measured`"


def _fit(field: FieldPath, experiment: Experiment, design: Design) -> _Found:
    if design.fit is None:
        return
    fit = experiment.fits.get(design.fit)
    if fit is None:
        yield (*field, "fit"), f"there is no fit `{design.fit}`; {suggest(design.fit, experiment.fits)}"
    elif fit.designed_for is None:
        yield (*field, "fit"), _other_family(design.fit, fit)
    if design.weights != DesignWeights(mean="fit"):
        message = (
            f"a choice for fit `{design.fit}` needs `weights: {{mean: fit}}` and nothing beside it: the rest comes from"
            " the fit"
        )
        yield (*field, "weights"), message


def _parameters(field: FieldPath, experiment: Experiment, design: Design, robot: RobotFile) -> _Found:
    chosen_for = experiment.fits.get(design.fit or "")
    freed = None if chosen_for is None else chosen_for.designed_for
    known = parameter_names(robot, (*design.free, *design.along(freed)))
    for index, name in enumerate(design.fixed):
        if name not in known:
            yield (*field, "fixed", index), f"nothing estimates `{name}`; {suggest(name, known)}"
    wanted = [name for name in parameter_names(robot, design.free) if name not in design.fixed]
    for key in _EARLIER:
        yield from _earlier((*field, key), experiment, getattr(design, key) or "", wanted, robot)


def _earlier(field: FieldPath, experiment: Experiment, name: str, wanted: list[str], robot: RobotFile) -> _Found:
    """What an earlier fit does not know of the wanted parameters."""
    fit = experiment.fits.get(name)
    if fit is None:
        return
    if fit.designed_for is None:
        yield field, _other_family(name, fit)
        return
    estimated = [each for each in parameter_names(robot, fit.designed_for) if each not in fit.not_estimated]
    missing = [f"`{each}`" for each in wanted if each not in estimated]
    if missing:
        message = (
            f"fit `{name}` does not estimate {', '.join(missing)}: fix them here, or estimate them there, each for"
            " itself"
        )
        yield field, message


def _other_family(name: str, fit: FitSettings) -> str:
    return f"fit `{name}` is of family `{fit.family}`, but a design knows elastic models only"

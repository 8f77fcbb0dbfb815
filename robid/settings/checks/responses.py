"""Sources of responses without a record: their channels, elements and files against each other and the robot."""

from __future__ import annotations

from robid.settings.base import DATA_VARIABLE
from robid.settings.checks.logs import check_outputs, wrong_kinds
from robid.settings.experiment import Campaign, Experiment
from robid.settings.fits import Families
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile
from robid.settings.sources import ResponseSource
from robid.settings.yaml import FieldPath
from robid.signals.log_channels import input_problems
from robid.signals.quantities import DRIVES
from robid.signals.response_options import ResponseOptions


def check_response(field: FieldPath, campaign: Campaign, source: ResponseSource) -> Found:
    """Finds what is wrong with a source of responses whatever the robot is."""
    inside = (*field, "source", "response")
    yield from check_options(inside, source)
    for name in (source.file, *(each.file for each in source.elements if each.file is not None)):
        yield from check_path((*inside, "file"), name)
    if campaign.estimate.compensation not in ("none",) or campaign.estimate.friction_fit is not None:
        told = "S612 friction can be subtracted from a record alone: leave `compensation` out, or set it to `none`"
        yield (*field, "estimate", "compensation"), told


def check_options(inside: FieldPath, options: ResponseOptions) -> Found:
    """Finds what contradicts itself in what files of responses mean."""
    for key, channels in (("inputs", options.inputs), ("outputs", options.outputs)):
        names = [one.name for one in channels]
        for index, channel in enumerate(channels):
            for problem in channel.problems():
                yield (*inside, key, index), problem
            if channel.name in names[:index]:
                yield (*inside, key, index, "name"), f"S610 `{channel.name}` is there twice"
    for problem in input_problems(options.inputs):
        yield (*inside, "inputs"), problem
    yield from _elements(inside, options)
    if options.input_rms and (len(options.input_rms) != len(options.inputs) or min(options.input_rms) <= 0):
        yield (*inside, "input_rms"), f"S611 needs a value above 0 for each of {len(options.inputs)} inputs"


def _elements(inside: FieldPath, source: ResponseOptions) -> Found:
    known = {"output": [one.name for one in source.outputs], "input": [one.name for one in source.inputs]}
    seen = set()
    for index, element in enumerate(source.elements):
        for problem in element.problems():
            yield (*inside, "elements", index), problem
        for side, names in known.items():
            own = getattr(element, side)
            if own not in names:
                yield (*inside, "elements", index, side), f"S613 there is no {side} `{own}`; {suggest(own, names)}"
        pair = element.output, element.input
        if pair in seen:
            yield (*inside, "elements", index), f"S614 `{pair[0]}` per `{pair[1]}` is there twice"
        seen.add(pair)


def check_path(field: FieldPath, name: str) -> Found:
    """Finds placeholders in the name of a file that nothing stands for."""
    rest = name.removeprefix(DATA_VARIABLE)
    try:
        rest.format(configuration=1)
    except (KeyError, IndexError, ValueError):
        yield field, "S615 only `{configuration}` stands for a number in a path of responses"
        return
    if "$" in rest:
        yield field, f"S619 only `{DATA_VARIABLE}`, at the start, is replaced in a path"


def check_response_of_robot(field: FieldPath, source: ResponseSource, robot: RobotFile) -> Found:
    """Finds channels that are not those of the robot."""
    inside = (*field, "source", "response")
    joints = [joint.name for joint in robot.joints]
    driving = [one for one in source.inputs if not one.problems() and one.channel.quantity in DRIVES]
    if len(driving) == len(source.inputs) and [one.name for one in source.inputs] != joints:
        yield (*inside, "inputs"), f"S618 must be one channel per joint, named in this order: {', '.join(joints)}"
    for index, output in enumerate(source.outputs):
        for key, problem in check_outputs(output, joints):
            yield (*inside, "outputs", index, key), problem
    for place, problem in wrong_kinds({"inputs": source.inputs, "outputs": source.outputs}, robot):
        yield (*inside, *place), problem


def check_readers(experiment: Experiment, families: Families) -> Found:
    """Yields fits and designs that need what a campaign of responses alone does not have."""
    for name, fit in experiment.fits.items():
        family, key = families[fit.family], "from"
        every = [*fit.campaigns, *((fit.validate_on,) if fit.validate_on else ())]
        given = {of: experiment.campaigns[of].is_response for of in every if of in experiment.campaigns}
        if "frf" in family.reads or not any(given.values()):
            continue
        if family.of_responses is None:
            told = "S616 campaign `{}` has responses alone, and family {} reads records"
            yield ("fits", name, key), told.format(next(of for of in given if given[of]), fit.family)
        elif not all(given.values()):
            told = "S620 campaign `{}` has a record, and others of this fit responses alone: fit them apart"
            yield ("fits", name, key), told.format(next(of for of in given if not given[of]))
    for name, design in experiment.designs.items():
        campaign = experiment.campaigns.get(design.campaign)
        if campaign is not None and campaign.is_response:
            told = f"S617 campaign `{design.campaign}` has responses that were measured elsewhere: nothing is to choose"
            yield ("designs", name, "campaign"), told

"""The external fit in an experiment file: its settings, what must hold of them, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.models.external.fit.options import ExternalOptions
from robid.settings.base import STRICT, Name
from robid.settings.checks.experiment import output_names
from robid.settings.experiment import Campaign, Experiment
from robid.settings.fits import FitSettings, fit_of, part
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class ExternalFit(FitSettings, ExternalOptions):
    """A fit of transfer functions from commands to positions."""

    family: Literal["external"] = Field(description="Family of the model.")
    choose_on: Name | None = Field(
        default=None,
        description="One of the campaigns of `from` that only decides the order: no parameter is fitted to it.",
    )

    def options(self) -> ExternalOptions:
        """Returns the options of the algorithm."""
        return part(self, ExternalOptions)


def external_fit(experiment: Experiment, name: str) -> ExternalFit:
    """Returns an external fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, ExternalFit)


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with an external fit."""
    fit = external_fit(experiment, name)
    limit = "poles" if fit.poles is not None else "max_poles"
    given = [each for each in fit.campaigns if each in experiment.campaigns and experiment.campaigns[each].is_response]
    if given:
        yield from _of_responses(fit)
    elif fit.zeros is not None and fit.zeros >= (fit.poles or fit.max_poles):
        most = fit.poles or fit.max_poles
        yield ("zeros",), f"S061 is not below `{limit}` ({most}): transfer functions are strictly proper"
    if fit.choose_on is not None and fit.choose_on not in fit.campaigns:
        yield ("choose_on",), f"S063 names `{fit.choose_on}`, which is none of the campaigns in `from`"
    elif fit.choose_on is not None and len(fit.campaigns) == 1:
        yield ("choose_on",), "S064 names the only campaign in `from`: nothing is left to fit"
    elif fit.choose_on is not None and fit.rule == "evidence":
        yield ("choose_on",), "S065 decides nothing with `rule: evidence`: set `rule: sufficient`, or leave it out"
    read = [*fit.campaigns, *(() if fit.validate_on is None else (fit.validate_on,))]
    for campaign in (experiment.campaigns[each] for each in read if each in experiment.campaigns):
        if fit.start == "periodic" and campaign.is_one_shot:
            yield ("start",), "S062 is `periodic`, but a campaign is one shot: let it be `free`, or `rest`"
            break
    yield from _pairs(experiment, fit, read, robot)


def _of_responses(fit: ExternalFit) -> _Found:
    """Yields what a fit to responses cannot be."""
    most = (fit.poles or fit.max_poles) - fit.relative_degree
    if fit.zeros is not None and fit.zeros > most:
        yield ("zeros",), f"S621 exceeds poles less `relative_degree` ({most})"
    if fit.relative_degree < 0 and fit.time == "discrete":
        yield ("relative_degree",), "S622 is negative: functions in z have at most as many zeros as poles"
    if fit.choose_on is not None:
        yield ("choose_on",), "S623 decides nothing of responses: their order is chosen by evidence"


def _pairs(experiment: Experiment, fit: ExternalFit, read: Sequence[str], robot: RobotFile) -> _Found:
    """Yields pairs of channels that a campaign lacks, and those that are there twice."""
    for name in read:
        if name not in experiment.campaigns:
            continue
        known = _channel_names(experiment.campaigns[name], robot)
        for index, pair in enumerate(fit.pairs):
            for side, one, names in zip(("input", "output"), pair, known, strict=True):
                if one not in names:
                    message = f"S066 campaign `{name}` has no {side} `{one}`; {suggest(one, names)}"
                    yield ("pairs", index), message
    for index, pair in enumerate(fit.pairs):
        if pair in fit.pairs[:index]:
            yield ("pairs", index), "S067 is there twice"


def _channel_names(campaign: Campaign, robot: RobotFile) -> tuple[tuple[str, ...], tuple[str, ...]]:
    outputs = output_names(campaign, robot)
    if campaign.source is not None and campaign.source.response is not None:
        return tuple(channel.name for channel in campaign.source.response.inputs), outputs
    if campaign.source is not None and campaign.source.acquire is not None:
        acquire = campaign.source.acquire
        return tuple(channel.name for channel in acquire.references or acquire.inputs), outputs
    # What is commanded comes first, then what else is measured.
    return outputs[: len(outputs) - len(campaign.outputs[1:])], outputs

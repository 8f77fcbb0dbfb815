"""The position-dependent fit in an experiment file: its settings, what must hold of them, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.models.lpv.fit.options import BasisOptions, LpvOptions
from robid.settings.base import STRICT, Name, Place
from robid.settings.checks.configurations import configuration_count
from robid.settings.checks.experiment import input_names, output_names
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, fit_of, part
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class LpvFit(FitSettings, LpvOptions):
    """A fit of one sparse state-space model to responses at several positions."""

    family: Literal["lpv"] = Field(description="Family of the model.")
    scheduling: tuple[str, ...] = Field(
        description="Scheduling variables: names of joints, or of outputs, whose mean is used.", min_length=1
    )
    choose_on: Name | Annotated[tuple[Place, ...], Field(min_length=1)] = Field(
        description="Data that only choose the structure: one of the campaigns of `from`, or numbers, from 1, "
        "of configurations that the fit reads. No parameter is fitted to them."
    )
    inputs: tuple[str, ...] = Field(default=(), description="Inputs of the model; all when empty.")
    outputs: tuple[str, ...] = Field(default=(), description="Outputs of the model; all when empty.")
    basis: BasisOptions = Field(
        default_factory=BasisOptions, description="Functions of the scheduling parameters, besides the constant one."
    )
    confidence: float = Field(default=0.95, description="Level of the intervals.", gt=0, lt=1)
    identifiable_relative_std: float = Field(
        default=0.2,
        description="Relative standard deviation up to which a natural frequency or damping ratio counts as"
        " identifiable.",
        gt=0,
    )

    def options(self) -> LpvOptions:
        """Returns the options of the algorithm."""
        return part(self, LpvOptions)


def lpv_fit(experiment: Experiment, name: str) -> LpvFit:
    """Returns a position-dependent fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, LpvFit)


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with a position-dependent fit."""
    fit = lpv_fit(experiment, name)
    yield from _chosen_on(experiment, fit)
    yield from _functions(experiment, fit)
    if fit.basis.center and len(fit.basis.center) != len(fit.scheduling):
        yield (
            ("basis", "center"),
            f"S070 has {len(fit.basis.center)} values for {len(fit.scheduling)} scheduling parameters",
        )
    if fit.basis.kind == "splines" and fit.basis.center:
        yield ("basis", "center"), "S071 is of polynomials; splines have none"
    if fit.campaign not in experiment.campaigns:
        return
    known = output_names(experiment.campaigns[fit.campaign], robot)
    driven = input_names(experiment.campaigns[fit.campaign], robot)
    yield from _channels(fit, "input", fit.inputs, driven)
    yield from _channels(fit, "output", fit.outputs, known)
    joints = tuple(joint.name for joint in robot.joints)
    for index, one in enumerate(fit.scheduling):
        if one not in (*joints, *known):
            yield ("scheduling", index), f"S072 there is no joint or output `{one}`; {suggest(one, (*joints, *known))}"
        elif one in fit.scheduling[:index]:
            yield ("scheduling", index), "S073 is there twice"
    if min(fit.integrators, default=0) < 0:
        yield ("integrators",), "S074 has a count below 0"
    count = len(fit.outputs or known)
    if fit.integrators and len(fit.integrators) != count:
        yield ("integrators",), f"S075 has {len(fit.integrators)} counts for {count} outputs"


def _channels(fit: LpvFit, word: str, wanted: tuple[str, ...], known: tuple[str, ...]) -> _Found:
    for index, one in enumerate(wanted):
        if one not in known:
            yield (f"{word}s", index), f"S076 campaign `{fit.campaign}` has no {word} `{one}`; {suggest(one, known)}"
        elif one in wanted[:index]:
            yield (f"{word}s", index), f"S077 `{one}` is there twice"


def _chosen_on(experiment: Experiment, fit: LpvFit) -> _Found:
    if isinstance(fit.choose_on, str):
        if fit.choose_on not in fit.campaigns:
            yield ("choose_on",), f"S078 names `{fit.choose_on}`, which is none of the campaigns in `from`"
        elif len(fit.campaigns) == 1:
            yield ("choose_on",), "S079 names the only campaign in `from`: nothing is left to fit"
        return
    count = _count(experiment, fit)
    for index, one in enumerate(fit.choose_on):
        if fit.configurations is not None and one not in fit.configurations:
            yield ("choose_on", index), f"S080 is {one + experiment.counts_from}, which is none of `configurations`"
        elif count is not None and one >= count:
            what = f"S081 there is no configuration {one + experiment.counts_from}: {experiment.numbered(count)}"
            yield ("choose_on", index), what
    if count is not None and set(fit.choose_on) >= set(fit.configurations or range(count)):
        yield ("choose_on",), "S082 leaves no configuration to fit: leave it fewer of them"


def _functions(experiment: Experiment, fit: LpvFit) -> _Found:
    """Yields a basis of more functions than positions are fitted."""
    count, named = _count(experiment, fit), isinstance(fit.choose_on, str) and fit.choose_on in experiment.campaigns
    if count is None or (isinstance(fit.choose_on, str) and (not named or fit.configurations is not None)):
        return
    if isinstance(fit.choose_on, str):
        left = count - (configuration_count(experiment, experiment.campaigns[fit.choose_on]) or 0)
    else:
        left = len(set(fit.configurations or range(count)) - set(fit.choose_on))
    wanted = fit.basis.count(len(fit.scheduling))
    if 0 < left < wanted:
        message = (
            f"S083 {left} positions cannot tell {wanted} functions apart, the constant one counted: lower"
            f" {'`degree` or `pieces`' if fit.basis.kind == 'splines' else '`degree`'}, or fit more positions"
        )
        yield ("basis",), message


def _count(experiment: Experiment, fit: LpvFit) -> int | None:
    """Number of configurations of a fit's campaigns, None where one is unknown."""
    used = [experiment.campaigns.get(name) for name in fit.campaigns]
    counts = [None if one is None else configuration_count(experiment, one) for one in used]
    return None if None in counts else sum(each or 0 for each in counts)

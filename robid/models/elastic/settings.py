"""The elastic fit in an experiment file: its settings, and what decides a fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import pydantic.dataclasses
from pydantic import Field

from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.parameters import ElasticKind
from robid.settings.base import STRICT, Name
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, HandedOn, fit_of, part
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, robot_settings


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class ElasticFit(FitSettings, ElasticOptions):
    """A fit of springs and dampers to frequency responses."""

    family: Literal["elastic"] = Field(description="Family of the model.")
    rigid: Name | None = Field(
        default=None,
        description="Name of a fit of family `rigid` whose masses, inertias and viscous friction replace the "
        "robot file's. What that fit does not determine widens the intervals.",
    )
    springs_from: Name | None = Field(
        default=None,
        description="Name of a fit of family `transmission` whose gears are known beforehand. The stiffness that it "
        "identified, and a cubic coefficient, replace the robot file's with their physical intervals; so does the "
        "torque at which hysteresis slips, where `free` has `hysteresis`.",
    )

    @property
    def takes(self) -> Mapping[HandedOn, str]:
        """Names of the fits that it takes something of, by what it takes."""
        named: tuple[tuple[HandedOn, str | None], ...] = (("standard", self.rigid), ("gears", self.springs_from))
        return {what: fit for what, fit in named if fit is not None}

    @property
    def designed_for(self) -> tuple[ElasticKind, ...]:
        """Kinds of parameters that configurations can be chosen for."""
        return self.kinds

    @property
    def not_estimated(self) -> frozenset[str]:
        """Names of parameters of these kinds that stay fixed or follow others."""
        return frozenset((*self.fixed, *self.tied))

    def options(self) -> ElasticOptions:
        """Returns the options of the algorithm."""
        return part(self, ElasticOptions)


def elastic_fit(experiment: Experiment, name: str) -> ElasticFit:
    """Returns an elastic fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, ElasticFit)


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the elastic model of a campaign is made of; the delay of a log is none."""
    used = loaded.experiment.campaigns[campaign]
    parts = robot_settings(loaded, "mechanics", "inertia_std", "torque_constant", "doubts", "sensors")
    settings = {f"campaigns.{campaign}.payload_kg": used.payload_kg, **parts}
    settings["delay_s"] = delay_s(loaded, used)
    return settings

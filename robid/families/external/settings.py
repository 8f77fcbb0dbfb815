"""The external fit in an experiment file: its settings, what must hold of them, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.fit.external.options import ExternalOptions
from robid.settings.base import STRICT, Name
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, fit_of, part
from robid.settings.load import LoadedExperiment
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
    del robot
    fit = external_fit(experiment, name)
    if fit.zeros is not None and fit.zeros >= (fit.poles or fit.max_poles):
        limit = "poles" if fit.poles is not None else "max_poles"
        yield (
            ("zeros",),
            f"is not below `{limit}` ({fit.poles or fit.max_poles}): transfer functions are strictly proper",
        )
    if fit.choose_on is not None and fit.choose_on not in fit.campaigns:
        yield ("choose_on",), f"names `{fit.choose_on}`, which is none of the campaigns in `from`"
    elif fit.choose_on is not None and len(fit.campaigns) == 1:
        yield ("choose_on",), "names the only campaign in `from`: nothing is left to fit"


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the model of a campaign is made of beside the fit's own settings: nothing of the robot."""
    del loaded, campaign
    return {}

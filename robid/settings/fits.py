"""What every fit of an experiment file says, whatever its family, and what loading a file asks of a family."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Literal, Protocol, TypeAlias, TypeVar

import pydantic.dataclasses
from pydantic import Field

from robid.robot.parameters import ElasticKind
from robid.settings.base import STRICT, Name, Place

if TYPE_CHECKING:
    from robid.settings.experiment import Experiment
    from robid.settings.problems import Found
    from robid.settings.robot import RobotFile

Read: TypeAlias = Literal["record", "frf"]
HandedOn: TypeAlias = Literal["friction", "standard", "gears"]
"""What other nodes may take of a fit: motor friction, the standard parameters of a rigid robot, or its gears."""
_Options = TypeVar("_Options")
_Fit = TypeVar("_Fit", bound="FitSettings")


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class FitSettings:
    """What every fit says: its family, what it reads, and what it is validated on."""

    family: str = Field(description="Family of the model.")
    reads: Name | Annotated[tuple[Name, ...], Field(min_length=1)] = Field(
        alias="from",
        description="Name of the campaign it reads, or of several with the same lines, such as two amplitudes.",
    )
    configurations: tuple[Place, ...] | None = Field(
        default=None,
        description="Numbers, from 1, of the campaign's configurations to use; those of further campaigns "
        "continue the count. All when not given.",
        min_length=1,
    )
    validate_on: Name | None = Field(default=None, description="Name of the campaign it is validated on.")

    @property
    def campaigns(self) -> tuple[str, ...]:
        """Names of the campaigns it reads."""
        return (self.reads,) if isinstance(self.reads, str) else self.reads

    @property
    def campaign(self) -> str:
        """The first of them; what the fit needs to know of it holds for all."""
        return self.campaigns[0]

    @property
    def hands_on(self) -> tuple[HandedOn, ...]:
        """What other nodes may take of it."""
        return ()

    @property
    def takes(self) -> Mapping[HandedOn, str]:
        """Names of the fits that it takes something of, by what it takes."""
        return {}

    @property
    def takes_payloads(self) -> bool:
        """Whether its campaigns may have different payloads."""
        return False

    @property
    def designed_for(self) -> tuple[ElasticKind, ...] | None:
        """Kinds of parameters that configurations can be chosen for; None where none can be."""
        return None

    @property
    def not_estimated(self) -> frozenset[str]:
        """Names of parameters of these kinds that stay fixed or follow others."""
        return frozenset()


class SettingsOfFamily(Protocol):
    """What loading a file, its schema and its checks ask of a family."""

    @property
    def name(self) -> str:
        """What `family` says in the file."""

    @property
    def settings(self) -> type[FitSettings]:
        """Type of its fits, its `family` a literal of the name; or what stands for it, of a `with later` block."""

    @property
    def reads(self) -> tuple[Read, ...]:
        """What of a campaign its fits read."""

    @property
    def needs_robot(self) -> bool:
        """Whether its fits ask for the inside of the robot."""

    @property
    def of_responses(self) -> SettingsOfFamily | None:
        """What fits in its place where campaigns have responses alone, if anything does."""

    @property
    def problems(self) -> Callable[[Experiment, str, RobotFile], Found]:
        """Finds what is wrong with one of its fits for a robot, by the fit's name: fields below the fit, messages."""


Families: TypeAlias = Mapping[str, SettingsOfFamily]


def fit_of(experiment: Experiment, name: str, kind: type[_Fit]) -> _Fit:
    """Returns a fit of an experiment as its family's own type.

    Raises:
        TypeError: If it is of another family.
    """
    fit = experiment.fits[name]
    if not isinstance(fit, kind):
        message = f"fit {name} is of family {fit.family}"
        raise TypeError(message)
    return fit


def part(settings: object, kind: type[_Options]) -> _Options:
    """Returns the options that settings are composed of, as an object of their own."""
    return kind(**{field.name: getattr(settings, field.name) for field in dataclasses.fields(kind)})  # type: ignore[arg-type]

"""Models of the part of a study of mistakes that reads logs in wrong units."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, StringConstraints

from robid.results.scale import CHANNELS, OWN_SCALES, SCALES
from robid.settings.base import Name, Section

LogSignal: TypeAlias = Literal["angle", "arm", "speed"]
"""What a log may hold beside the torques: angles of motors and arms, speeds of motors."""

SCALE_PATTERN = rf"^({'|'.join(CHANNELS)}) ([x/]) ({'|'.join([*SCALES, *OWN_SCALES])})$"
ScaleText = Annotated[str, StringConstraints(pattern=SCALE_PATTERN)]
"""A wrong scale, as in `motor_angle x 180/pi`: the values that are read are too large by it, or `/` too small."""


class Physics(Section):
    """What is simulated otherwise than the campaigns say."""

    imperfections: dict[str, Any] = Field(
        default_factory=dict, description="`imperfections` that take the place of the campaigns'."
    )
    truth: dict[str, Any] = Field(default_factory=dict, description="`truth` that takes the place of the campaigns'.")


class UnitRobot(Section):
    """A simulated robot whose logs are read."""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    fit: Name = Field(description="Name of its fit, of any family, with a campaign to validate on, both simulated.")
    log: tuple[LogSignal, ...] = Field(
        default=("angle",), description="What its logs hold beside time and motor torques.", min_length=1
    )
    counts_per_turn: float = Field(default=65536, description="Counts of one turn of a motor's encoder.", gt=0)
    torque_constant_nm_a: float = Field(
        description="Torque constant of the motors, which the robot file states too [N m/A].", gt=0
    )
    variants: tuple[Physics, ...] = Field(
        default=(Physics(),),
        description="How true robots differ beside their seed, in what the model lacks too; seeds take turns.",
        min_length=1,
    )


class UnitMistake(Section):
    """A unit or a scale of a log that is stated wrongly."""

    scale: ScaleText = Field(
        description="What is wrong: a channel, `x` where the values that are read are too large or `/` where they are"
        " too small, and the factor."
    )
    one_joint: bool = Field(default=False, description="Whether it is that of one joint, by the seed; else of all.")
    stamps: bool = Field(
        default=True, description="Whether the log has a time channel; else only its sampling period is stated."
    )
    log: dict[Name, tuple[LogSignal, ...]] = Field(
        default_factory=dict, description="What the logs hold in the place of the robot's `log`, by robot."
    )
    same: dict[Name, tuple[ScaleText, ...]] = Field(
        default_factory=dict, description="Further scales that give the same data, by robot: its group."
    )
    refusals: tuple[str, ...] = Field(
        default=(), description="Words by which a refusal names it, beside those of its scale."
    )


class Rough(Section):
    """How far the robot files of sound records are off: each value by its own log-uniform factor, up to these."""

    rotor_inertia: float = Field(default=2.5, description="Rotor inertias.", ge=1)
    mass: float = Field(default=2.0, description="Mass and inertia of each link.", ge=1)
    inertia: float = Field(default=1.5, description="Inertia of each link beside that.", ge=1)
    spring: float = Field(default=3.0, description="Springs.", ge=1)
    damper: float = Field(default=3.0, description="Dampers.", ge=1)
    friction: float = Field(default=3.0, description="Viscous coefficient and dry levels of each motor.", ge=1)
    torque_constant: float = Field(default=2.0, description="Torque constant of each motor.", ge=1)


class UnitMistakes(Section):
    """Logs in wrong units, and sound ones of robots whose files are rough."""

    robots: dict[Name, UnitRobot] = Field(description="The robots, by name.", min_length=1)
    only: tuple[Name, ...] | None = Field(
        default=None, description="The robots that are read; all when not given.", min_length=1
    )
    mistakes: dict[Name, UnitMistake] = Field(description="The mistakes, by name; each with every robot.", min_length=1)
    rough: Rough = Field(default_factory=Rough, description="How rough the robot files of the sound records are.")

    @property
    def chosen(self) -> dict[str, UnitRobot]:
        """The robots that are read."""
        return {name: robot for name, robot in self.robots.items() if self.only is None or name in self.only}

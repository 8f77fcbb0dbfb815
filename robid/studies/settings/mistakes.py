"""The study of mistakes: its section of an experiment file, and what must hold around it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, StringConstraints

from robid.results.finding import CAUSES
from robid.results.scale import CHANNELS, OWN_SCALES, SCALES
from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.experiments import Count, Positive, Problems, Whole, fit_problem, physics_problems, unknown

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
        ("angle",), description="What its logs hold beside time and motor torques.", min_length=1
    )
    counts_per_turn: Positive = Field(65536, description="Counts of one turn of a motor's encoder.")
    torque_constant_nm_a: Positive = Field(
        description="Torque constant of the motors, which the robot file states too [N m/A]."
    )
    variants: tuple[Physics, ...] = Field(
        (Physics(),),
        description="How true robots differ beside their seed, in what the model lacks too; seeds take turns.",
        min_length=1,
    )


class UnitMistake(Section):
    """A unit or a scale of a log that is stated wrongly."""

    scale: ScaleText = Field(
        description="What is wrong: a channel, `x` where the values that are read are too large or `/` where they are"
        " too small, and the factor."
    )
    one_joint: bool = Field(False, description="Whether it is that of one joint, by the seed; else of all.")
    stamps: bool = Field(
        True, description="Whether the log has a time channel; else only its sampling period is stated."
    )
    log: dict[Name, tuple[LogSignal, ...]] = Field(
        default_factory=dict, description="What the logs hold in the place of the robot's `log`, by robot."
    )
    same: dict[Name, tuple[ScaleText, ...]] = Field(
        default_factory=dict, description="Further scales that give the same data, by robot: its group."
    )
    refusals: tuple[str, ...] = Field((), description="Words by which a refusal names it, beside those of its scale.")


class Rough(Section):
    """How far the robot files of sound records are off: each value by its own log-uniform factor, up to these."""

    rotor_inertia: float = Field(2.5, description="Rotor inertias.", ge=1)
    mass: float = Field(2.0, description="Mass and inertia of each link.", ge=1)
    inertia: float = Field(1.5, description="Inertia of each link beside that.", ge=1)
    spring: float = Field(3.0, description="Springs.", ge=1)
    damper: float = Field(3.0, description="Dampers.", ge=1)
    friction: float = Field(3.0, description="Viscous coefficient and dry levels of each motor.", ge=1)
    torque_constant: float = Field(2.0, description="Torque constant of each motor.", ge=1)


class UnitMistakes(Section):
    """Logs in wrong units, and sound ones of robots whose files are rough."""

    robots: dict[Name, UnitRobot] = Field(description="The robots, by name.", min_length=1)
    only: tuple[Name, ...] | None = Field(
        None, description="The robots that are read; all when not given.", min_length=1
    )
    mistakes: dict[Name, UnitMistake] = Field(description="The mistakes, by name; each with every robot.", min_length=1)
    rough: Rough = Field(default_factory=Rough, description="How rough the robot files of the sound records are.")

    @property
    def chosen(self) -> dict[str, UnitRobot]:
        """The robots that are read."""
        return {name: robot for name, robot in self.robots.items() if self.only is None or name in self.only}


class Mistake(Physics):
    """One mistake with its size, in the logs, in the robot file that the fit reads, or in what is simulated."""

    cause: str | None = Field(
        None, description="The cause that it should be blamed on; none where there is no single one."
    )
    robot: Literal["heavy", "light"] = Field(
        "heavy", description="Whose robot it is made with: this file's or that of `light`."
    )
    torque_factor: dict[Name, float] = Field(
        default_factory=dict, description="Logs: factors of the torques, by joint; -1 is a wrong sign."
    )
    angle_factor: dict[Name, float] = Field(
        default_factory=dict, description="Logs: factors of the motor angles, by joint; -1 is a wrong sign."
    )
    swapped: tuple[int, int] | None = Field(
        None,
        description="Logs: indices, from 0, of two configurations of the estimation that are taken for each other.",
    )
    delay_samples: Whole = Field(0, description="Logs: samples by which the angles come late.")
    gear_ratio_factor: dict[Name, float] = Field(
        default_factory=dict, description="Robot file: factors of the gear ratios, by joint."
    )
    without_springs: tuple[str, ...] = Field((), description="Robot file: names of the springs that it lacks.")
    friction_factor: Positive = Field(
        1.0, description="Robot file: factor of the Coulomb and breakaway levels of all motors."
    )
    excitation_factor: Positive = Field(1.0, description="Simulation: factor of the excitation.")

    @property
    def physics(self) -> dict[str, Any]:
        """What is simulated otherwise than for a sound robot; empty where its record serves."""
        changed: dict[str, Any] = {"imperfections": self.imperfections, "truth": self.truth}
        if self.excitation_factor != 1:
            changed["excitation_factor"] = self.excitation_factor
        return {key: value for key, value in changed.items() if value}


class SeedChoice(Section):
    """Seeds of true robots and noise."""

    first: Whole = Field(description="The first seed; further ones follow it.")
    mistakes: Count = Field(5, description="Seeds with which each mistake is made, from the first.")
    heavy: Count = Field(40, description="Sound robots of this file.")
    light: Whole = Field(10, description="Sound robots of `light`.")
    units: Count = Field(5, description="Seeds with which each log is read in wrong units.")
    rough: Whole = Field(20, description="Sound logs of each robot of `units`, their robot files rough.")

    def end(self, *, units: bool) -> int:
        """Returns the first seed that is none of them, where a study reads `units`, or not."""
        read = (self.units, self.rough) if units else ()
        return self.first + max(self.mistakes, self.heavy, self.light, *read)


class Seeds(Section):
    """Two disjoint sets of seeds: thresholds are chosen with one, the stated figures come from the other."""

    judge: SeedChoice = Field(description="Those of the stated figures.")
    choose: SeedChoice = Field(description="Those that thresholds are chosen with.")


class MistakesStudy(Section):
    """What grade a fit gets where something is wrong, and what it is blamed on."""

    kind: Literal["mistakes"] = Field(description="What is studied.")
    fit: Name = Field(description="Name of the fit, with a campaign to validate on, both simulated.")
    light: str | None = Field(
        None,
        description="Experiment file, relative to this one, of a light robot, with a fit of the same name.",
        min_length=1,
    )
    seeds: Seeds = Field(description="Seeds of the robots.")
    use: Literal["judge", "choose"] = Field("judge", description="Which of the seeds are used.")
    mistakes: dict[Name, Mistake] = Field(description="The mistakes, by name.", min_length=1)
    units: UnitMistakes | None = Field(None, description="Logs that are read in wrong units.")
    only: Literal["mistakes", "units"] | None = Field(
        None, description="What is done alone: `mistakes`, or `units`; both when not given."
    )

    @property
    def makes_mistakes(self) -> bool:
        """Whether `mistakes` are made."""
        return self.only != "units"

    @property
    def reads_units(self) -> bool:
        """Whether `units` is done."""
        return self.units is not None and self.only != "mistakes"

    @property
    def chosen(self) -> SeedChoice:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose


def check_mistakes(study: MistakesStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of mistakes."""
    yield from robot_problems(study, "heavy", experiment, robot)
    for name, mistake in study.mistakes.items():
        field = ("study", "mistakes", name)
        if mistake.cause is not None and (message := unknown("cause", mistake.cause, CAUSES)):
            yield (*field, "cause"), message
        if mistake.robot == "light" and study.light is None:
            yield (*field, "robot"), "S396 the study has no `light` robot"
    yield from _check_units(study)
    judge, choose = study.seeds.judge, study.seeds.choose
    first, last = sorted((judge, choose), key=lambda seeds: seeds.first)
    if first.end(units=study.units is not None) > last.first:
        yield ("study", "seeds"), "S397 the seeds of `judge` and `choose` overlap"


def _check_units(study: MistakesStudy) -> Problems:
    """Yields robots that a mistake of units names and that are not there."""
    if study.units is None:
        if study.only == "units":
            yield ("study", "only"), "S398 the study has no `units`"
        return
    robots = study.units.robots
    yield from _unknown(("study", "units", "only"), study.units.only or (), "robot", list(robots))
    for name, mistake in study.units.mistakes.items():
        for key in ("log", "same"):
            field = ("study", "units", "mistakes", name, key)
            yield from _unknown(field, list(getattr(mistake, key)), "robot", list(robots))


def robot_problems(study: MistakesStudy, name: str, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields what the fit, or mistakes with the study's robot `heavy` or `light`, names that its file does not have."""
    problem = fit_problem(experiment, study.fit)
    if problem:
        yield ("study", "fit"), problem
    for key, mistake in study.mistakes.items():
        if mistake.robot == name:
            field: FieldPath = ("study", "mistakes", key)
            if not problem:
                campaign = experiment.campaigns[experiment.fits[study.fit].campaign]
                found = physics_problems(campaign, mistake.physics, robot)
                yield from (((*field, *place), message) for place, message in found)
            yield from () if robot is None else _name_problems(field, mistake, robot)


def _name_problems(field: FieldPath, mistake: Mistake, robot: RobotFile) -> Problems:
    joints, springs = [joint.name for joint in robot.joints], [spring.name for spring in robot.all_springs]
    for key in ("torque_factor", "angle_factor", "gear_ratio_factor"):
        yield from _unknown((*field, key), list(getattr(mistake, key)), "joint", joints)
    for index, name in enumerate(mistake.without_springs):
        yield from _unknown((*field, "without_springs", index), [name], "spring", springs)


def _unknown(field: FieldPath, names: Sequence[str], kind: str, known: Sequence[str]) -> Problems:
    yield from ((field, message) for name in names if (message := unknown(kind, name, known)))

"""The study of mistakes: its section of an experiment file, what it describes, and its checks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import StringConstraints

from robid.results.finding import CAUSES
from robid.results.scale import CHANNELS, OWN_SCALES, SCALES
from robid.settings.base import Name, Place, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.experiments import (
    Count,
    Positive,
    Problems,
    Whole,
    entry,
    fit_problem,
    physics_problems,
    unknown,
)

LogSignal: TypeAlias = Literal["angle", "arm", "speed"]
"""What a log may hold beside the torques: angles of motors and arms, speeds of motors."""

SCALE_PATTERN = rf"^({'|'.join(CHANNELS)}) ([x/]) ({'|'.join([*SCALES, *OWN_SCALES])})$"
ScaleText = Annotated[str, StringConstraints(pattern=SCALE_PATTERN)]
"""A wrong scale, as in `motor_angle x 180/pi`: the values that are read are too large by it, or `/` too small."""


class Physics(Section):
    """What is simulated otherwise than the campaigns say."""

    imperfections: dict[str, Any] = entry("`imperfections` that replace those of the campaigns.", default_factory=dict)
    truth: dict[str, Any] = entry("`truth` that replaces that of the campaigns.", default_factory=dict)


class UnitRobot(Section):
    """A simulated robot whose logs are read."""

    experiment: str = entry("Experiment file, relative to this one.", min_length=1)
    fit: Name = entry("Name of its fit, of any family, with a campaign to validate on, both simulated.")
    log: tuple[LogSignal, ...] = entry(
        "Content of its logs in addition to time and motor torques.", ("angle",), min_length=1
    )
    counts_per_turn: Positive = entry("Counts of one turn of a motor's encoder.", 65536)
    torque_constant_nm_a: Positive = entry("Torque constant of the motors, which the robot file states too [N m/A].")
    variants: tuple[Physics, ...] = entry(
        "Differences of true robots in addition to their seed, also in what the model lacks; seeds take turns.",
        (Physics(),),
        min_length=1,
    )


class UnitMistake(Section):
    """A unit or a scale of a log that is stated wrongly."""

    scale: ScaleText = entry(
        "The mistake: a channel, `x` where the read values are too large or `/` where they are too small, and "
        "the factor."
    )
    one_joint: bool = entry("Whether it affects one joint, chosen by the seed; else all.", False)
    stamps: bool = entry("Whether the log has a time channel; otherwise only its sampling period is stated.", True)
    log: dict[Name, tuple[LogSignal, ...]] = entry(
        "Content of the logs in place of the robot's `log`, by robot.", default_factory=dict
    )
    same: dict[Name, tuple[ScaleText, ...]] = entry(
        "Further scales that give the same data, by robot: its group.", default_factory=dict
    )
    refusals: tuple[str, ...] = entry("Words by which a refusal names it, in addition to those of its scale.", ())


class Rough(Section):
    """How far the robot files of sound records are off: each value by its own log-uniform factor, up to these."""

    rotor_inertia: float = entry("Rotor inertias.", 2.5, ge=1)
    mass: float = entry("Mass and inertia of each link.", 2.0, ge=1)
    inertia: float = entry("Inertia of each link beside that.", 1.5, ge=1)
    spring: float = entry("Springs.", 3.0, ge=1)
    damper: float = entry("Dampers.", 3.0, ge=1)
    friction: float = entry("Viscous coefficient and dry friction of each motor.", 3.0, ge=1)
    torque_constant: float = entry("Torque constant of each motor.", 2.0, ge=1)


class UnitMistakes(Section):
    """Logs in wrong units, and sound ones of robots whose files are rough."""

    robots: dict[Name, UnitRobot] = entry("The robots, by name.", min_length=1)
    only: tuple[Name, ...] | None = entry("The robots that are read; all when not given.", None, min_length=1)
    mistakes: dict[Name, UnitMistake] = entry("The mistakes, by name; each with every robot.", min_length=1)
    rough: Rough = entry("Errors of the robot files of the sound records.", default_factory=Rough)

    @property
    def chosen(self) -> dict[str, UnitRobot]:
        """The robots that are read."""
        return {name: robot for name, robot in self.robots.items() if self.only is None or name in self.only}


class Mistake(Physics):
    """One mistake with its size, in the logs, in the robot file that the fit reads, or in what is simulated."""

    cause: str | None = entry("The right cause; none where there is no single one.", None)
    robot: Literal["heavy", "light"] = entry("Robot of the mistake: this file's or that of `light`.", "heavy")
    torque_factor: dict[Name, float] = entry(
        "Logs: factors of the torques, by joint; -1 is a wrong sign.", default_factory=dict
    )
    angle_factor: dict[Name, float] = entry(
        "Logs: factors of the motor angles, by joint; -1 is a wrong sign.", default_factory=dict
    )
    swapped: tuple[Place, Place] | None = entry(
        "Logs: numbers, from 1, of two configurations of the estimation that are exchanged.", None
    )
    delay_samples: Whole = entry("Logs: delay of the angles in samples.", 0)
    gear_ratio_factor: dict[Name, float] = entry(
        "Robot file: factors of the gear ratios, by joint.", default_factory=dict
    )
    without_springs: tuple[str, ...] = entry("Robot file: names of the springs that it lacks.", ())
    friction_factor: Positive = entry("Robot file: factor of the Coulomb and breakaway torques of all motors.", 1.0)
    excitation_factor: Positive = entry("Simulation: factor of the excitation.", 1.0)

    @property
    def physics(self) -> dict[str, Any]:
        """What is simulated otherwise than for a sound robot; empty where its record serves."""
        changed: dict[str, Any] = {"imperfections": self.imperfections, "truth": self.truth}
        if self.excitation_factor != 1:
            changed["excitation_factor"] = self.excitation_factor
        return {key: value for key, value in changed.items() if value}


class SeedChoice(Section):
    """Seeds of true robots and noise."""

    first: Whole = entry("The first seed; further ones follow it.")
    mistakes: Count = entry("Seeds with which each mistake is made, from the first.", 5)
    heavy: Count = entry("Sound robots of this file.", 40)
    light: Whole = entry("Sound robots of `light`.", 10)
    units: Count = entry("Seeds with which each log is read in wrong units.", 5)
    rough: Whole = entry("Sound logs of each robot of `units`, their robot files rough.", 20)

    def end(self, *, units: bool) -> int:
        """Returns the first seed that is none of them, where a study reads `units`, or not."""
        read = (self.units, self.rough) if units else ()
        return self.first + max(self.mistakes, self.heavy, self.light, *read)


class Seeds(Section):
    """Two disjoint sets of seeds: thresholds are chosen with one, the stated figures come from the other."""

    judge: SeedChoice = entry("Seeds of the stated figures.")
    choose: SeedChoice = entry("Seeds for choosing thresholds.")


class MistakesStudy(Section):
    """What grade a fit gets where something is wrong, and what it is blamed on."""

    kind: Literal["mistakes"] = entry("What is studied.")
    fit: Name = entry("Name of the fit, with a campaign to validate on, both simulated.")
    light: str | None = entry(
        "Experiment file, relative to this one, of a light robot, with a fit of the same name.", None, min_length=1
    )
    seeds: Seeds = entry("Seeds of the robots.")
    use: Literal["judge", "choose"] = entry("Which of the seeds are used.", "judge")
    mistakes: dict[Name, Mistake] = entry("The mistakes, by name.", min_length=1)
    units: UnitMistakes | None = entry("Logs that are read in wrong units.", None)
    only: Literal["mistakes", "units"] | None = entry(
        "Part that runs alone: `mistakes`, or `units`; both when not given.", None
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
    yield from mistaken_problems(study, "heavy", experiment, robot)
    for name, mistake in study.mistakes.items():
        field = ("study", "mistakes", name)
        if mistake.cause is not None and (message := unknown("cause", mistake.cause, CAUSES)):
            yield (*field, "cause"), message
        if mistake.robot == "light" and study.light is None:
            yield (*field, "robot"), "S396 the study has no `light` robot"
    if study.units is None and study.only == "units":
        yield ("study", "only"), "S398 the study has no `units`"
    if study.units is not None:
        robots = list(study.units.robots)
        yield from _unknown(("study", "units", "only"), study.units.only or (), "robot", robots)
        for name, wrong in study.units.mistakes.items():
            for key in ("log", "same"):
                yield from _unknown(("study", "units", "mistakes", name, key), getattr(wrong, key), "robot", robots)
    judge, choose = study.seeds.judge, study.seeds.choose
    first, last = sorted((judge, choose), key=lambda seeds: seeds.first)
    if first.end(units=study.units is not None) > last.first:
        yield ("study", "seeds"), "S397 the seeds of `judge` and `choose` overlap"


def mistaken_problems(study: MistakesStudy, name: str, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields what the fit, or mistakes with the study's robot `heavy` or `light`, names that its file does not have."""
    if problem := fit_problem(experiment, study.fit):
        yield ("study", "fit"), problem
    for key, mistake in study.mistakes.items():
        if mistake.robot == name:
            field: FieldPath = ("study", "mistakes", key)
            if not problem:
                campaign = experiment.campaigns[experiment.fits[study.fit].campaign]
                found = physics_problems(campaign, mistake.physics, robot)
                yield from (((*field, *place), message) for place, message in found)
            if robot is None:
                continue
            joints, springs = [joint.name for joint in robot.joints], [spring.name for spring in robot.all_springs]
            for part in ("torque_factor", "angle_factor", "gear_ratio_factor"):
                yield from _unknown((*field, part), getattr(mistake, part), "joint", joints)
            for index, spring in enumerate(mistake.without_springs):
                yield from _unknown((*field, "without_springs", index), [spring], "spring", springs)


def _unknown(field: FieldPath, names: Iterable[str], kind: str, known: Sequence[str]) -> Problems:
    yield from ((field, message) for name in names if (message := unknown(kind, name, known)))

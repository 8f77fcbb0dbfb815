"""Parts of a robot of which something may be off: joints, links, rotors, gears, springs, payload and base."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

from robid.models.elastic.fit.nuisance.moves import missing_springs
from robid.robot.description import Robot

_WRIST, _WITH_WRIST = 3, 6  # joints of a wrist whose motors sit before it, and of an arm that has one


@dataclass(frozen=True)
class Owner:
    """A part of a robot of which something may be off."""

    name: str  # Its name, with which those of its nuisance parameters begin; empty for the drives
    title: str  # The same for a sentence
    priors: object  # What has the deviations as attributes
    at: tuple[int, ...] = ()  # Its indices among the robot's parts
    more: str = ""  # What the names of its nuisance parameters end on
    linear: bool = False  # Whether it slides

    def named(self, ending: str) -> str:
        """Returns the name of what is its own."""
        return f"{self.name}.{ending}{self.more}" if self.name else ending


def joints(robot: Robot, title: str = "{}") -> Iterator[Owner]:
    """The joints."""
    for index, joint in enumerate(robot.joints):
        yield Owner(joint.name, title.format(joint.name), joint.nuisance_std, (index,))


links = partial(joints, title="link {}")


def rotors(robot: Robot) -> Iterator[Owner]:
    """The rotors of their motors."""
    for index, joint in enumerate(robot.joints):
        yield Owner(joint.name, joint.name, joint.motor, (index,))


def bases(robot: Robot) -> Iterator[Owner]:
    """What base springs carry, where there are any."""
    if robot.base is not None and any(spring.place == "base" for spring in robot.springs):
        yield Owner("base", "the base", robot.nuisance_std)


def payloads(robot: Robot) -> Iterator[Owner]:
    """The payload, where it has some mass."""
    if robot.payload.mass_kg > 0:
        yield Owner("payload", "the payload", robot.nuisance_std)


def drives(robot: Robot) -> Iterator[Owner]:
    """All drives alike."""
    yield Owner("", "", robot.nuisance_std)


def springs(robot: Robot) -> Iterator[Owner]:
    """The springs."""
    for index, spring in enumerate(robot.springs):
        priors = robot.nuisance_std if spring.place in ("base", "payload") else robot.joints[spring.joint].nuisance_std
        if spring.stiffness_std is not None:
            priors = replace(priors, stiffness_relative_std=spring.stiffness_std)
        yield Owner(spring.name, spring.name, priors, (index,), linear=robot.is_linear(spring))


def gears(robot: Robot) -> Iterator[Owner]:
    """The transmissions among the springs."""
    return (owner for owner in springs(robot) if robot.springs[owner.at[0]].place == "transmission")


def shafts(robot: Robot) -> Iterator[Owner]:
    """The springs that carry a shaft with inertia."""
    for index, spring in enumerate(robot.springs):
        if spring.inertia_kgm2 > 0:
            yield Owner(spring.name, spring.name, robot.joints[spring.joint].nuisance_std, (index,))


def missing(robot: Robot) -> Iterator[Owner]:
    """Springs that the file lacks, measured by the gear of their joint."""
    for index, spring in enumerate(missing_springs(robot)):
        priors = robot.nuisance_std if spring.place == "base" else robot.joints[spring.joint].nuisance_std
        yield Owner(spring.name, spring.name.replace("_", " "), priors, (index,))


def couplings(robot: Robot) -> Iterator[Owner]:
    """Gear couplings: those that the file states, and those of an arm's wrist."""
    n_joint = len(robot.joints)
    wrist = range(n_joint - _WRIST, n_joint) if n_joint >= _WITH_WRIST else range(0)
    for index, joint in enumerate(robot.joints):
        for other, driven in enumerate(robot.joints):
            inside = other < index and index in wrist and other in wrist
            turning = joint.type == driven.type == "revolute" and other != index and not robot.rigid[index]
            if turning and (inside or driven.name in joint.couplings):
                title = f"turn of {joint.name} by the motor of {driven.name}"
                yield Owner(joint.name, title, joint.nuisance_std, (index, other), driven.name)


def unbalanced(robot: Robot) -> Iterator[Owner]:
    """Joints that turn; none where the file states counterbalances, which the elastic model does not know."""
    if all(joint.counterbalance is None for joint in robot.joints):
        for owner in joints(robot):
            if robot.joints[owner.at[0]].type == "revolute":
                yield owner

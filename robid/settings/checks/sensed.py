"""What must hold of joints whose torque is measured at the joint, and what cannot be done with them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.experiment import Campaign, Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


def check_sensed(field: FieldPath, robot: RobotFile, joint: JointSection) -> _Found:
    """Yields what contradicts a sensor that measures a joint's torque behind its gear."""
    why = f"the torque of `{joint.name}` is measured at the joint, behind"
    if joint.motor is not None:
        yield (*field, "motor"), f"{why} motor and gear: leave `motor` out, or `torque_measured_at`"
    if joint.couplings:
        yield (*field, "couplings"), f"{why} all motors that turn it: leave `couplings` out"
    springs = [spring.name for spring in robot.all_springs if _drives(spring.place) and spring.joint == joint.name]
    if springs:
        place = "gear" if joint.gear is not None else "name"
        yield (*field, place), f"{why} its gear, whose spring it does not show: leave {', '.join(springs)} out"


def check_experiment_of_sensed(experiment: Experiment, robot: RobotFile) -> _Found:
    """Yields simulations, excitations and choices of configurations, which need a motor at every joint."""
    names = robot.without_motor
    if not names:
        return
    told = without_motor_text(names)
    for name, campaign in experiment.campaigns.items():
        what = _needs_motors(campaign)
        if what:
            key, verb = what
            yield ("campaigns", name, *key), f"{verb} a motor at every joint: {told}"
    for name in experiment.designs:
        yield ("designs", name), f"a choice of configurations needs a motor at every joint: {told}"


def without_motor_text(names: tuple[str, ...]) -> str:
    """Says which joints have no motor, and what to do where one is needed."""
    listed = ", ".join(f"`{name}`" for name in names)
    has, of = ("has", "it") if len(names) == 1 else ("have", "them")
    return (
        f"{listed} {has} none (`torque_measured_at: joint`); give {of} a `motor` in a robot file of its own, or import"
        " logs (`acquire`) for fits of family `rigid`"
    )


def _needs_motors(campaign: Campaign) -> tuple[FieldPath, str] | None:
    """Where a campaign needs motors, and what of it does."""
    if campaign.source is None:
        return (), "an excitation needs"
    if campaign.source.acquire is None:
        return ("source", "simulate"), "a simulation needs"
    if campaign.source.acquire.references and not (campaign.is_one_shot or campaign.is_arbitrary):
        return ("source", "acquire", "references"), "an excitation that is designed here needs"
    return None


def _drives(place: str) -> bool:
    return place in ("transmission", "shaft")

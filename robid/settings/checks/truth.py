"""What must hold in the truth of a simulated campaign."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.checks.robot import check_springs
from robid.settings.experiment import Campaign
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.truth import SimulateSettings, TruthSettings, with_truth_springs
from robid.settings.yaml import FieldPath
from robid.simulate.options import Imperfections

_Found = Iterator[tuple[FieldPath, str]]
_BODIES = ("payload", "base")


def check_truth(field: FieldPath, campaign: Campaign, simulate: SimulateSettings, robot: RobotFile) -> _Found:
    """Yields names that the robot does not have, factors that none has, and springs that cannot be.

    Args:
        field: Where the settings of the simulation stand.
        campaign: The campaign.
        simulate: Its simulation.
        robot: The robot file.
    """
    truth = simulate.truth
    springs = [spring.name for spring in robot.all_springs]
    for index, name in enumerate(truth.keep):
        if name not in springs:
            yield (*field, "truth", "keep", index), f"there is no spring `{name}`; {suggest(name, springs)}"
    yield from _factors((*field, "truth"), truth, robot)
    yield from _drives((*field, "truth"), truth, robot)
    yield from _springs((*field, "truth", "springs"), truth, robot)
    yield from _friction((*field, "imperfections"), simulate.imperfections)
    extra = simulate.imperfections.unmodelled_payload_kg
    yield from _payload((*field, "imperfections", "unmodelled_payload_kg"), extra, campaign, robot)


def _factors(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> _Found:
    joints = [joint.name for joint in robot.joints]
    own = {"payload": robot.payload, "base": robot.base}
    bodies = [*joints, *(name for name in _BODIES if own[name] is not None)]
    known = {
        "rotor_inertia_factor": joints,
        "mass_factor": bodies,
        "inertia_factor": bodies,
        "torque_constant_factor": joints,
    }
    for key, names in known.items():
        for name, factor in getattr(truth, key).items():
            if name not in names:
                kind = "body" if names is bodies else "joint"
                yield (*field, key, name), f"there is no {kind} `{name}`; {suggest(name, names)}"
            if factor <= 0:
                yield (*field, key, name), f"must be above 0 (found {factor:g})"
    for index, name in enumerate(truth.reversed_torque):
        if name not in joints:
            yield (*field, "reversed_torque", index), f"there is no joint `{name}`; {suggest(name, joints)}"


def _drives(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> _Found:
    joints = [joint.name for joint in robot.joints]
    least, most = truth.mass_relative
    if not 0 <= least <= most < 1:
        yield (*field, "mass_relative"), f"must be two shares below 1, the smaller first (found {least:g}, {most:g})"
    for joint, others in truth.couplings.items():
        for name in (joint, *others):
            if name not in joints:
                yield (*field, "couplings", joint), f"there is no joint `{name}`; {suggest(name, joints)}"
        if joint in others:
            yield (*field, "couplings", joint), "a joint's own motor moves it by its gear ratio"
    turning = [joint.name for joint in robot.joints if joint.type == "revolute" and joint.counterbalance is None]
    for name in truth.counterbalance_nm:
        if name not in turning:
            message = f"there is no revolute joint `{name}` without a counterbalance; {suggest(name, turning)}"
            yield (*field, "counterbalance_nm", name), message


def _friction(field: FieldPath, flaws: Imperfections) -> _Found:
    for key in ("load_friction", "friction_asymmetry"):
        if getattr(flaws, key) and flaws.friction == "none":
            yield (*field, key), "changes the levels of a friction law: give `friction` too"


def _springs(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> _Found:
    for index, spring in enumerate(truth.springs):
        if spring.place == "transmission":
            message = "every joint has its transmission in the robot file; `spring_factor` changes it"
            yield (*field, index, "place"), message
    own = len(robot.springs)
    for (section, *rest), message in check_springs(with_truth_springs(robot, truth)):
        if section == "springs" and isinstance(rest[0], int) and rest[0] >= own:
            yield (*field, rest[0] - own, *rest[1:]), message


def _payload(field: FieldPath, extra_kg: float, campaign: Campaign, robot: RobotFile) -> _Found:
    if extra_kg == 0:
        return
    stated = 0.0 if robot.payload is None else robot.payload.mass_kg
    mass = stated if campaign.payload_kg is None else campaign.payload_kg
    if mass == 0:
        message = "the robot carries no payload whose mass could differ: give the robot file a `payload` with mass"
        yield field, message
    elif mass + extra_kg < 0:
        yield field, f"the payload has {mass:g} kg: no more than that can be missing (found {extra_kg:g})"
    elif mass + extra_kg == 0 and any(spring.place == "payload" for spring in robot.springs):
        yield field, "a payload on springs needs some mass"

"""The same robot described in another world, or with the axis of a joint the other way, by hand."""

from dataclasses import replace

import numpy as np

FLIP = np.diag([1.0, -1.0, -1.0])
"""Half a turn about x: z points the other way."""


def _turned_body(body, turn):
    return replace(body, com_m=turn @ body.com_m, inertia_kgm2=turn @ body.inertia_kgm2 @ turn.T)


def in_turned_world(robot, turn):
    """The robot and its gravity turned together by a rotation (3, 3) of the world."""
    first, *others = robot.joints
    first = replace(first, position_m=turn @ first.position_m, rotation=turn @ first.rotation)
    springs = tuple(
        replace(spring, axis=turn @ spring.axis, point_m=turn @ spring.point_m) if spring.place == "base" else spring
        for spring in robot.springs
    )
    return replace(
        robot,
        gravity_m_s2=turn @ robot.gravity_m_s2,
        joints=(first, *others),
        springs=springs,
        base=None if robot.base is None else _turned_body(robot.base, turn),
    )


def with_axis_reversed(robot, index):
    """The robot whose joint counts the other way, with its link's frame turned along; the gear ratio stays.

    Its motor then counts the other way too.
    """
    last = index == len(robot.joints) - 1
    joints = list(robot.joints)
    own = joints[index]
    joints[index] = replace(
        own,
        rotation=own.rotation @ FLIP,
        link=_turned_body(own.link, FLIP),
        lower=-own.upper,
        upper=-own.lower,
        couplings={name: -turn for name, turn in own.couplings.items()},
    )
    for other, joint in enumerate(joints):
        if own.name in joint.couplings:
            joints[other] = replace(joint, couplings=joint.couplings | {own.name: -joint.couplings[own.name]})
    if not last:
        after = joints[index + 1]
        joints[index + 1] = replace(after, position_m=FLIP @ after.position_m, rotation=FLIP @ after.rotation)
    springs = tuple(_reversed_spring(spring, index, last=last) for spring in robot.springs)
    payload = _turned_body(robot.payload, FLIP) if last else robot.payload
    return replace(robot, joints=tuple(joints), springs=springs, payload=payload)


def _reversed_spring(spring, index, *, last):
    """A spring in the turned frame of a joint; gears and shafts lie along its axis whichever way that points."""
    if spring.joint != index or spring.place in ("transmission", "shaft", "base"):
        return spring
    outboard = None if spring.outboard is None else _turned_body(spring.outboard, FLIP)
    if spring.place == "payload" and not last:
        return spring
    return replace(spring, axis=FLIP @ spring.axis, point_m=FLIP @ spring.point_m, outboard=outboard)


def signs_of(robot, index):
    """Sign (n_joint,) of each joint's position, and of its motor's angle and torque, after that."""
    return np.where(np.arange(len(robot.joints)) == index, -1.0, 1.0)

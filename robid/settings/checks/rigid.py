"""What must hold of the counterbalances and closed loops of a robot file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.robot.regressor.base import pin_gaps
from robid.settings.counterbalance import HARMONIC_KEYS, SPRING_KEYS
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_CLOSED_M = 1e-5
_N_POSE = 20


def check_counterbalances(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with the counterbalances."""
    for index, joint in enumerate(robot.joints):
        balance, field = joint.counterbalance, ("joints", index, "counterbalance")
        if balance is None:
            continue
        stated = [key for key in SPRING_KEYS if getattr(balance, key) is not None]
        harmonics = [key for key in HARMONIC_KEYS if getattr(balance, key)]
        if stated and harmonics:
            yield (*field, harmonics[0]), "is a counterbalance of another kind than the spring: leave one of them out"
        elif not stated and not harmonics:
            yield field, f"is empty: give {' or '.join(HARMONIC_KEYS)}, or a spring ({', '.join(SPRING_KEYS)})"
        elif stated:
            yield from (((*field, key), "is missing") for key in SPRING_KEYS if key not in stated)
        elif joint.slides:
            yield (*field, harmonics[0]), f"belongs to a revolute joint: `{joint.name}` is prismatic"


def check_loop_links(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with the links of closed loops."""
    joints, known = [joint.name for joint in robot.joints], [joint.name for joint in robot.joints]
    found: list[tuple[FieldPath, str]] = []
    for index, link in enumerate(robot.loop_links):
        field = ("loop_links", index)
        if link.parent is not None and link.parent not in known:
            told = f"there is no joint or loop link `{link.parent}` before it; {suggest(link.parent, known)}"
            found.append(((*field, "parent"), told))
        strangers = [name for name in link.turns if name not in joints]
        found += [
            ((*field, "turns", name), f"there is no joint `{name}`; {suggest(name, joints)}") for name in strangers
        ]
        if link.pin is not None and link.pin.joint not in joints:
            told = f"there is no joint `{link.pin.joint}`; {suggest(link.pin.joint, joints)}"
            found.append(((*field, "pin", "joint"), told))
        rotation = np.array(link.frame.rotation)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > _CLOSED_M or np.linalg.det(rotation) < 0:
            told = "is not a rotation: rows must be right-handed unit axes"
            found.append(((*field, "frame", "rotation"), told))
        known.append(link.name)
    yield from found
    if not found and robot.loop_links and robot.is_complete:
        yield from _open_loops(robot)


def _open_loops(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    plain = robot.to_robot()
    poses = np.random.default_rng(0).uniform(plain.lower, plain.upper, (_N_POSE, len(plain.joints)))
    pinned = [index for index, link in enumerate(robot.loop_links) if link.pin is not None]
    for index, gap in zip(pinned, pin_gaps(plain, poses).max(axis=0).tolist(), strict=True):
        if gap > _CLOSED_M:
            name = robot.loop_links[index].name
            told = f"`{name}` does not close its loop: its pin is up to {1e3 * gap:.3g} mm from where it is held"
            yield ("loop_links", index, "pin"), told

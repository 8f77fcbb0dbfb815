"""Kinematics of a rigid arm with a tool, many samples at once: poses, Jacobians, and joint positions that reach poses.

The arm stands on a root; axes below the root, such as a rail, carry it and move nothing that is said here.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, check_shape
from robid.robot.description import Joint, Robot
from robid.robot.inertia import about_z, turned_about_z
from robid.signals.pose import POSE, RAIL, displaced_pose

_NEWTON_STEPS = 12
_CLOSE = 1e-11  # How far, in m and rad, a pose that is reached may be from the one that was asked for
_SINGULAR = 1e-4  # Least over greatest singular value of a Jacobian below which a direction counts as lost
_STRIDE = 0.1  # How far, in m or rad, poses move from one start of Newton's steps to the next
_HALVINGS = 8
_TAKES_PART = 0.3
_HARDLY = 0.05


@dataclass(frozen=True)
class ToolArm:
    """A rigid arm on its root, and its tool."""

    robot: Robot
    external: int  # How many joints, from the first on, ride below the root
    tool_m: FloatArray  # (3,) Tool point in the last joint's frame [m]
    tool_rotation: FloatArray  # (3, 3) Orientation of the tool in the last joint's frame

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints above the root."""
        return self.robot.joints[self.external :]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of what can be commanded: X Y Z, the external axes, A B C; a single external axis is the rail R."""
        names = tuple(joint.name for joint in self.robot.joints[: self.external])
        return (*POSE[:3], *((RAIL,) if len(names) == 1 else names), *POSE[3:])

    def poses(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places the tool in the root.

        Args:
            positions (..., n_arm): Arm-side positions of the joints above the root [rad, or m].

        Returns:
            Positions (..., 3) [m] and orientations (..., 3, 3) in the root: the last external axis' frame at zero
            position carried along, or the world.
        """
        point, turn, _ = self.chain(positions)
        return point, turn

    def jacobian(self, positions: FloatArray) -> FloatArray:
        """Jacobians (..., 6, n_arm): velocity of the tool point [m], and angular velocity [1], in the root.

        Args:
            positions (..., n_arm): Arm-side positions of the joints above the root [rad, or m].
        """
        point, _, axes = self.chain(positions)
        return self.moves(point, axes)

    def in_home(self, positions: FloatArray) -> FloatArray:
        """Returns the Jacobian (6, n_arm) from joints to X, Y, Z, A, B, C of displacements from these positions."""
        _, turn = self.poses(positions)
        jacobian = self.jacobian(positions)
        # About the home pose itself A, B, C are small turns about its z, y and x.
        return np.concatenate([turn.T @ jacobian[:3], (turn.T @ jacobian[3:])[::-1]])

    def chain(self, positions: FloatArray) -> tuple[FloatArray, FloatArray, list[tuple[FloatArray, FloatArray]]]:
        """Returns position and orientation of the tool, and axis and origin (..., 3) of each joint, all in the root."""
        shape = positions.shape[:-1]
        point: FloatArray = np.zeros((*shape, 3))
        turn: FloatArray = np.broadcast_to(np.eye(3), (*shape, 3, 3))
        axes: list[tuple[FloatArray, FloatArray]] = []
        for joint, moved in zip(self.joints, np.moveaxis(positions, -1, 0), strict=True):
            point, turn = point + turn @ joint.position_m, turn @ joint.rotation
            # The axis and a point on it give each column of the Jacobian: omega x r, and omega.
            axes.append((turn[..., 2], point))
            if joint.type == "prismatic":
                point = point + moved[..., None] * turn[..., 2]
            else:
                turn = turned_about_z(turn, moved)
        return point + turn @ self.tool_m, turn @ self.tool_rotation, axes

    def moves(self, point: FloatArray, axes: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """Returns the Jacobians (..., 6, n_arm) of a tool point whose joints have these axes and origins."""
        jacobian = np.zeros((*point.shape[:-1], 6, len(axes)))
        for index, (joint, (axis, origin)) in enumerate(zip(self.joints, axes, strict=True)):
            if joint.type == "prismatic":
                jacobian[..., :3, index] = axis
            else:
                # A turn moves the tool by axis x (tool - origin).
                jacobian[..., :3, index] = np.cross(axis, point - origin)
                jacobian[..., 3:, index] = axis
        return jacobian


@dataclass(frozen=True)
class Reached:
    """What an arm does to take poses."""

    positions: FloatArray  # (n_sample, n_arm) Joint positions, as far as they lead [rad, or m]
    share: FloatArray  # (n_sample,) Share of the way from home that was found; 1 where the pose is reached
    # (n_arm,) Which joints, at the first sample that is not reached, move the tool against each other without effect;
    # none where all poses are reached or the way merely ends
    loose: BoolArray

    @property
    def is_whole(self) -> bool:
        """Whether every pose is reached."""
        return bool((self.share == 1).all())


def reach_poses(arm: ToolArm, home: FloatArray, displaced: FloatArray) -> Reached:
    """Finds joint positions that take displaced poses, on the branch that leads there from home.

    All samples go from home to their poses at once, in strides; after each, Newton's steps bring them onto the way.
    An arm of more than six joints moves as little as it can; one of fewer reaches what its joints allow.

    Args:
        arm: The arm.
        home (n_arm,): Joint positions at home [rad, or m].
        displaced (n_sample, 6): X, Y, Z [m], A, B, C [rad] along and about the axes of the tool at home.

    Returns:
        The joint positions; samples that cannot be reached stay where they came to.
    """
    check_shape("displaced", displaced, "n_sample axis", axis=6)
    at = arm.poses(home)
    # Poses move by at most a stride at once: Newton stays on the branch that it is on.
    strides = max(1, int(np.ceil(np.abs(displaced).max(initial=0.0) / _STRIDE)))
    found = np.broadcast_to(home, (len(displaced), home.size)).copy()
    share = np.zeros(len(displaced))
    going = np.flatnonzero(displaced.any(axis=1))
    share[~displaced.any(axis=1)] = 1.0
    for stride in range(1, strides + 1):
        positions, arrived = _newton(arm, found[going], displaced_pose(*at, displaced[going] * (stride / strides)))
        going = going[arrived]
        found[going], share[going] = positions[arrived], stride / strides
    for halving in range(1, _HALVINGS + 1):
        lost = np.flatnonzero(share < 1)
        # Halving finds how far the last stride leads; what is lost keeps its last position.
        ahead = share[lost] + 0.5**halving / strides
        positions, arrived = _newton(arm, found[lost], displaced_pose(*at, displaced[lost] * ahead[:, None]))
        found[lost[arrived]], share[lost[arrived]] = positions[arrived], ahead[arrived]
    loose = np.zeros(home.size, bool)
    lost = np.flatnonzero(share < 1)
    if len(lost):
        loose = _loose(arm, found[lost[np.argmin(share[lost])]])
    return Reached(found, share, loose)


def _newton(arm: ToolArm, positions: FloatArray, goal: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, BoolArray]:
    """Joint positions (n, n_arm) at poses, from others nearby, and which of them arrived on an unbroken way."""
    positions = positions.copy()
    close = np.zeros(len(positions), bool)
    for _ in range(_NEWTON_STEPS):
        busy = np.flatnonzero(~close)
        if not len(busy):
            break
        point, turn, axes = arm.chain(positions[busy])
        # Position error and the vector of the small turn between, as one screw.
        error = np.concatenate([goal[0][busy] - point, _small_turn(goal[1][busy], turn)], axis=-1)
        size = np.abs(error).max(axis=1)
        close[busy[size <= _CLOSE]] = True
        step = _solved(arm.moves(point, axes), error)
        # No step beyond 1 rad or m: near singular poses Newton would leave the branch.
        far = np.abs(step).max(axis=1, initial=0.0)
        positions[busy] += step * np.where(far > 1, 1 / np.maximum(far, 1), 1.0)[:, None]
    return positions, close & ~is_singular(arm.jacobian(positions))


def _solved(jacobian: FloatArray, error: FloatArray) -> FloatArray:
    """Steps (n, n_arm) of least norm that make good errors (n, 6)."""
    if jacobian.shape[-1] == jacobian.shape[-2]:
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(jacobian, error[..., None])[..., 0])
    return np.asarray((np.linalg.pinv(jacobian, rcond=_SINGULAR) @ error[..., None])[..., 0])


def is_singular(jacobian: FloatArray) -> BoolArray:
    """Whether Jacobians (..., 6, n_arm) have lost a direction."""
    size = np.linalg.svd(jacobian, compute_uv=False)
    return np.asarray(size[..., -1] < _SINGULAR * size[..., 0])


def _loose(arm: ToolArm, positions: FloatArray) -> BoolArray:
    """Which joints take part in the motion that moves the tool least, where it hardly moves it at all."""
    # The right singular vector of the least singular value moves joints against each other.
    _, size, motion = np.linalg.svd(arm.jacobian(positions))
    if size[-1] > _HARDLY * size[0]:
        return np.zeros(positions.size, bool)
    return np.asarray(np.abs(motion[len(size) - 1]) > _TAKES_PART)


def _small_turn(goal: FloatArray, turn: FloatArray) -> FloatArray:
    """Turns (n, 3) that lead from orientations to others nearby, to second order [rad]."""
    # The skew part of R R' is the axis times the sine of the angle.
    between = goal @ turn.swapaxes(-1, -2)
    return 0.5 * np.stack(
        [
            between[..., 2, 1] - between[..., 1, 2],
            between[..., 0, 2] - between[..., 2, 0],
            between[..., 1, 0] - between[..., 0, 1],
        ],
        axis=-1,
    )


def skeleton(robot: Robot, configurations: FloatArray, tool_m: FloatArray | None = None) -> FloatArray:
    """Points (n_conf, n_joint + 2, 3) of base, joints and tool in the base frame; springs do not deflect [m].

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side positions [rad, or m].
        tool_m (3,): Tool point in the last joint's frame; the payload's centre of mass by default [m].
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(robot.joints))
    n_conf = len(configurations)
    position, rotation = np.zeros((n_conf, 3)), np.broadcast_to(np.eye(3), (n_conf, 3, 3))
    points = [position]
    for joint, moved in zip(robot.joints, configurations.T, strict=True):
        position = position + rotation @ joint.position_m
        rotation = rotation @ joint.rotation
        if joint.type == "prismatic":
            position = position + moved[:, None] * rotation[:, :, 2]
        else:
            rotation = rotation @ about_z(moved)
        points.append(position)
    points.append(position + rotation @ (robot.payload.com_m if tool_m is None else tool_m))
    return np.stack(points, axis=1)

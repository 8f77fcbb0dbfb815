"""How a robot's matrices move with nuisances: in closed form with those of its bodies, by differences with others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from robid.errors import DataError
from robid.models.elastic.fit.nuisance.effects import Nuisance, RobotMove
from robid.models.elastic.fit.nuisance.scene import Scene, moves_matrices_alone
from robid.models.elastic.fit.rest_model import placed_robot, settle
from robid.robot.bodies import differ_in_bodies
from robid.robot.body_slopes import BodyChange, body_change, slopes_along_bodies
from robid.robot.derivatives import expand, slopes_between
from robid.robot.linearize import LinearModel, Shifts, linearize
from robid.robot.rest import MatrixSlopes


def find_shifts(scene: Scene, nuisances: Sequence[Nuisance], *, must_rest: bool = True) -> Shifts:
    """Finds how the matrices of a robot move with those nuisance parameters that are moves of it.

    Args:
        scene: The robot.
        nuisances: The nuisance parameters, others among them.
        must_rest: Whether robots near it must rest; otherwise nothing moves with those by which they do not.

    Raises:
        DataError: If a robot near it must rest and does not.
    """
    effects = [each.effect for each in nuisances if isinstance(each.effect, RobotMove)]
    changes = _changes_of_bodies(scene, effects)
    others = [row for row in range(len(effects)) if row not in changes]
    parts = [(list(changes), _along_bodies(scene, list(changes.values())))] if changes else []
    if others:
        pairs = [_sides(scene, effects[row], must_rest=must_rest) for row in others]
        parts.append((others, slopes_between(pairs, 2 * np.array([effects[row].step for row in others]))))
    order = np.argsort([row for rows, _ in parts for row in rows])
    slopes = {
        each.name: np.concatenate([getattr(part, each.name) for _, part in parts], axis=1)[:, order]
        for each in fields(MatrixSlopes)
    }
    nothing = np.zeros((len(effects), len(scene.robot.joints)))
    return Shifts(**slopes, amounts=nothing[:, 0], torque=nothing)


def _changes_of_bodies(scene: Scene, effects: Sequence[RobotMove]) -> dict[int, BodyChange]:
    """Which effects change a robot's bodies alone, and how; none where springs do not stay as they are under a load."""
    robot, found = scene.robot, dict[int, BodyChange]()
    varying = any(spring.stiffness_over is not None for spring in robot.springs)
    if varying or not moves_matrices_alone(scene.problem, scene.internal):
        return found
    placed = placed_robot(robot, scene.values.springs)
    for row, effect in enumerate(effects):
        behind, ahead = (effect.moved(placed, step) for step in (-effect.step, effect.step))
        if differ_in_bodies(placed, behind, ahead):
            found[row] = body_change(behind, ahead, 2 * effect.step)
    return found


def _along_bodies(scene: Scene, changes: Sequence[BodyChange]) -> MatrixSlopes:
    frf, springs, parameters = scene.problem.frf, scene.values.springs, scene.problem.parameters
    elastic, equilibrium = settle(scene.robot, frf.configurations, springs)
    linear = linearize(elastic, equilibrium, frf.output_names)
    linear = expand(elastic, equilibrium, linear, frf.output_names)
    # Links' own inertias that the fit estimates are as the robot file has them, see `with_estimated_links`.
    masks = dict(zip(parameters.kinds, parameters.masks, strict=True))
    known = masks.get("link_inertia", np.zeros(linear.axial.size, bool))
    return slopes_along_bodies(elastic, equilibrium, linear, springs.stiffness, changes, known)


def _sides(scene: Scene, effect: RobotMove, *, must_rest: bool) -> tuple[LinearModel, LinearModel]:
    """The robot with a little less and a little more of it; as it is where one of them does not rest."""
    try:
        behind, ahead = (
            scene.rested(effect.moved(scene.robot, step), scene.values)[0] for step in (-effect.step, effect.step)
        )
    except DataError:
        if must_rest:
            raise
        return scene.problem.model, scene.problem.model
    return behind, ahead

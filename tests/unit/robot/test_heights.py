"""Heights of a robot's points in closed form, against MuJoCo's kinematics and differences of themselves."""

from pathlib import Path

import numpy as np
import pytest

from rigid_robots import random_chain
from robid.robot.reach import heights, points
from robid.settings.load import load_robot
from tolerances import FINITE_DIFFERENCE, IDENTITY

ROBOTS = Path(__file__).parents[3] / "configs" / "robots"
KNOWN = {
    "chain": random_chain(7),
    "puma560": load_robot(ROBOTS / "puma560.yaml").to_robot(),
    "gantry": load_robot(ROBOTS / "gantry.yaml").to_robot(),
}


def drawn(robot):
    return np.random.default_rng(1).uniform(-1, 1, (5, len(robot.joints)))


@pytest.mark.parametrize("name", KNOWN)
def test_heights_are_those_of_the_engine(name):
    """Its points come in another order, origins first, and its last link has the payload in its centre of mass."""
    found, wanted = heights(KNOWN[name], drawn(KNOWN[name]))[0], points(KNOWN[name], drawn(KNOWN[name]))[..., 2]
    found, wanted = np.delete(found, -2, axis=1), np.delete(wanted, -2, axis=1)
    np.testing.assert_allclose(np.sort(found), np.sort(wanted), rtol=IDENTITY, atol=IDENTITY)


@pytest.mark.parametrize("name", KNOWN)
def test_slopes_are_those_of_the_heights(name):
    robot, step = KNOWN[name], 1e-6
    _, slopes = heights(robot, drawn(robot))
    for joint in range(len(robot.joints)):
        moved = step * np.eye(len(robot.joints))[joint]
        change = heights(robot, drawn(robot) + moved)[0] - heights(robot, drawn(robot) - moved)[0]
        np.testing.assert_allclose(change / (2 * step), slopes[..., joint], atol=FINITE_DIFFERENCE)

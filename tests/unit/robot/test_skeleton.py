"""Joint origins of the rigid robot against MuJoCo's kinematics."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from exact_systems import springs_everywhere, two_joint_robot
from robid.robot.kinematics import skeleton
from robid.robot.model import build_model
from robid.settings.load import load_robot
from tolerances import IDENTITY

KR300 = Path(__file__).parents[3] / "configs" / "robots" / "kr300.yaml"


def mujoco_points(robot, configuration, tool):
    """Base, joint origins and a point on the last link, the elastic model's springs straight."""
    model = build_model(robot)
    data = mujoco.MjData(model.mujoco)
    data.qpos[model.arm] = configuration
    mujoco.mj_kinematics(model.mujoco, data)
    joints = [data.xanchor[model.mujoco.dof_jntid[index]] for index in model.arm]
    last = model.mujoco.body(robot.joints[-1].name).id
    return np.array([np.zeros(3), *joints, data.xpos[last] + data.xmat[last].reshape(3, 3) @ tool])


@pytest.mark.parametrize("which", ["kr300", "springs_everywhere", "leaning"])
def test_points_are_those_of_mujoco(which):
    robot = load_robot(KR300).to_robot() if which == "kr300" else springs_everywhere()
    if which == "leaning":
        first = replace(two_joint_robot().joints[0], position_m=np.array([0.1, -0.2, 0.4]))
        robot = replace(two_joint_robot(), joints=(first, *two_joint_robot().joints[1:]))
    tool = np.array([0.2, -0.1, 0.3])
    configurations = np.random.default_rng(3).uniform(-2, 2, (4, len(robot.joints)))
    expected = [mujoco_points(robot, configuration, tool) for configuration in configurations]
    np.testing.assert_allclose(skeleton(robot, configurations, tool), expected, atol=IDENTITY)
    own = skeleton(robot, configurations[:1])
    np.testing.assert_allclose(own, [mujoco_points(robot, configurations[0], robot.payload.com_m)], atol=IDENTITY)


def test_configurations_must_fit_the_robot():
    with pytest.raises(ValueError, match="n_joint=2"):
        skeleton(two_joint_robot(), np.zeros((1, 3)))

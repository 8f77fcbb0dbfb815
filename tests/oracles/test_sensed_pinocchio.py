"""Torques at the joints of published arms by Pinocchio, as a rigid model without motors has them."""

import numpy as np
import pytest

from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from tolerances import IDENTITY

pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")


@pytest.mark.parametrize("model", ["iiwa14", "panda_nohand"])
def test_torques_of_published_arms(tmp_path, data_folder, model):
    file = data_folder("robot_models") / "mjcf_meshfree" / f"{model}.xml"
    arm = pin.buildModelFromMJCF(str(file))
    arm.armature[:] = 0.0
    lines = [f"  - {{name: {name}, torque_measured_at: joint}}" for name in list(arm.names)[1:]]
    text = "\n".join(["schema_version: 1", f"name: {model}", f"model: {file}", "joints:", *lines])
    (tmp_path / "robot.yaml").write_text(text + "\n")
    robot = load_robot(tmp_path / "robot.yaml").to_robot()
    rigid = build_rigid_model(robot)
    assert "motor_inertia" not in rigid.kinds
    motion = np.random.default_rng(0).uniform(-1, 1, (3, 20, arm.nq))
    values = np.where([kind in ("viscous", "coulomb") for kind in rigid.kinds], 0.0, rigid.nominal)
    data = arm.createData()
    wanted = np.array([pin.rnea(arm, data, *own) for own in motion.swapaxes(0, 1)])
    found = rigid.torques(values, *motion)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=IDENTITY * np.abs(wanted).max())

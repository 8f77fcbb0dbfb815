"""The exported MJCF, linearised by MuJoCo's own finite differences, against the parametric response.

MuJoCo's semi-implicit Euler takes damping half a step late, so errors fall with the step, and Richardson's
extrapolation removes what is left of first order.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from exact_systems import arm_on_rail, linear_axis, two_joint_robot, without_spring
from robid.robot.export import to_mjcf
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.settings.load import load_robot
from robid.simulate.options import Truth
from robid.simulate.truth import true_robot
from tolerances import MJCF

KR300 = load_robot(Path(__file__).parents[2] / "configs/robots/kr300.yaml").to_robot()
CASES = {
    "two joints": (two_joint_robot(), np.array([0.4, -0.9])),
    "linear axis": (linear_axis(), np.array([0.3])),
    "arm on a rail": (arm_on_rail(), np.array([0.5, 0.4, -0.9])),
    "rigid elbow": (without_spring(two_joint_robot(), "gear_2"), np.array([0.4, -0.9])),
    # At the rail's zero, away from which finite differences of a free axis round more.
    "arm on a rigid rail": (without_spring(arm_on_rail(), "gear_rail"), np.array([0.0, 0.4, -0.5])),
    "kr300": (true_robot(KR300, Truth(spring_factor=2.0, seed=1)), np.deg2rad([10.0, -60.0, 70.0, 30.0, 40.0, 20.0])),
}
LINES_HZ = np.geomspace(2.0, 80.0, 60)
STEPS_S = (4e-5, 2e-5, 1e-5)
PERTURBATION = 3e-4


def response_of_mjcf(text, step_s):
    """Acceleration per torque (n_freq, n_out, n_in) at the first keyframe, from nothing but the file."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, step_s
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    A, B = np.zeros((2 * model.nv, 2 * model.nv)), np.zeros((2 * model.nv, model.nu))
    mujoco.mjd_transitionFD(model, data, PERTURBATION, True, A, B, None, None)
    drives = [(model.actuator_trnid[i, 0], model.actuator_gear[i, 0]) for i in range(model.nu)]
    motors = np.array([gear * np.eye(len(A))[model.jnt_dofadr[joint]] for joint, gear in drives])
    identity = np.eye(len(A))
    omega = 2 * np.pi * LINES_HZ
    return np.array([-(w**2) * motors @ np.linalg.solve(np.exp(1j * w * step_s) * identity - A, B) for w in omega])


@pytest.mark.parametrize("case", CASES)
def test_simulators_response_is_the_fitted_one(case):
    robot, configuration = CASES[case]
    model = build_model(robot)
    rest = solve_statics(model, configuration[None])
    linear = linearize(model, rest)
    wanted = response(linear, nominal_parameters(robot, linear, 0.0), LINES_HZ, None).sampled[0]
    text = to_mjcf(model, rest, ("rest",), "")
    found = [response_of_mjcf(text, step) for step in STEPS_S]
    errors = [np.linalg.norm(one - wanted) / np.linalg.norm(wanted) for one in found]
    np.testing.assert_allclose(np.diff(np.log(errors)) / np.log(0.5), 1.0, atol=0.15)
    # Each element at each line, antiresonances included.
    assert np.abs(found[-1] / wanted - 1).max() < MJCF
    assert np.abs((2 * found[-1] - found[-2]) / wanted - 1).max() < 0.3 * MJCF

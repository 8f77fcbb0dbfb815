"""The loop of a rigid model: with a payload that is a body of its own, or without it."""

from pathlib import Path

import numpy as np
import pytest

from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from robid.simulate.rigid_loop import simulate_rigid_loop
from tolerances import IDENTITY

CARRIER = Path(__file__).parents[2] / "stages" / "carrier_robot.yaml"
VISCOUS = RigidOptions(friction="viscous", offsets=False)


@pytest.fixture(scope="module")
def commands():
    """Motor angles (2, n_sample, 3) of two smooth runs."""
    time = np.arange(300) * 1e-3
    rise = 0.5 - 0.5 * np.cos(np.pi * time / time[-1])
    return np.array([[8.0, -12.0, 6.0], [-5.0, 9.0, 7.0]])[:, None] * rise[None, :, None]


@pytest.mark.parametrize("loaded", [True, False])
def test_a_payload_is_there_only_where_it_was(commands, loaded):
    file = load_robot(CARRIER)
    apart = build_rigid_model(file.to_robot(8.0), RigidOptions(friction="viscous", offsets=False, payload="body"))
    robot = file.to_robot(8.0 if loaded else 0.0)
    whole = build_rigid_model(robot, VISCOUS)
    found = simulate_rigid_loop(apart, apart.nominal, robot, file.controller, commands, loaded=loaded)[0]
    wanted = simulate_rigid_loop(whole, whole.nominal, robot, file.controller, commands)[0]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=100 * IDENTITY * np.abs(commands).max())
    other = simulate_rigid_loop(apart, apart.nominal, robot, file.controller, commands, loaded=not loaded)[0]
    assert np.abs(found - other).max() > 1e-3
    assert np.abs(found - commands).max() < 0.5 * np.abs(commands).max(), "the loop follows its commands"


def test_a_run_that_is_lost_ends_without_a_warning(commands):
    file = load_robot(CARRIER)
    robot = file.to_robot()
    model = build_rigid_model(robot, VISCOUS)
    heavy = [name.endswith((".ZZ", ".motor_inertia")) for name in model.names]
    found = simulate_rigid_loop(
        model, np.where(heavy, -model.nominal, model.nominal), robot, file.controller, commands
    )[0]
    assert np.isnan(found[:, -1]).all()
    assert np.isfinite(found[:, 0]).all()

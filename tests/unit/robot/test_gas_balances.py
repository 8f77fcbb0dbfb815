"""Gas cylinders as counterbalances: closed forms, virtual work, statics and what a simulation does with them."""

from dataclasses import replace

import numpy as np
import pytest
from mujoco.batch import Batch

from rigid_robots import planar_arm
from robid.errors import DataError
from robid.robot.balances import GasBalance, HarmonicBalance, SpringBalance, balance_slope, balance_torque, stretch
from robid.robot.linearize import gravity_torque
from robid.robot.model import build_model
from robid.robot.regressor.model import build_rigid_model
from robid.robot.standard import with_standard
from robid.simulate.engine import PointBalances
from tolerances import FINITE_DIFFERENCE, IDENTITY

CARRIER, LINK, FREE = np.array([-0.2, 0.5, 0.1]), np.array([0.3, -0.1, 0.4]), 0.35
AREA, PRESSURE, VOLUME = 2e-3, 5e6, 6e-3
PLACES = np.linspace(-1.5, 1.5, 31)


def cylinder(exponent, area=AREA):
    return GasBalance(CARRIER, LINK, FREE, area, PRESSURE, VOLUME, exponent)


def points(position, slides):
    """Distance of the two points, from where they are."""
    if slides:
        return np.linalg.norm(LINK + np.array([0, 0, position]) - CARRIER)
    turn = np.array([[np.cos(position), -np.sin(position), 0], [np.sin(position), np.cos(position), 0], [0, 0, 1]])
    return np.linalg.norm(turn @ LINK - CARRIER)


def work(position, exponent, area, slides):
    """Work that the gas has taken up: of p V = p0 V0 its logarithm, else a power of the volume."""
    ratio = 1 - area * (points(position, slides) - FREE) / VOLUME
    if exponent == 1:
        return -PRESSURE * VOLUME * np.log(ratio)
    return PRESSURE * VOLUME / (exponent - 1) * (ratio ** (1 - exponent) - 1)


def arm(balance, kind="revolute"):
    robot = planar_arm(1)
    return replace(robot, joints=(replace(robot.joints[0], type=kind, counterbalance=balance),))


@pytest.mark.parametrize("area", [AREA, -AREA])
@pytest.mark.parametrize("exponent", [1.0, 1.3])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_the_torque_is_the_slope_of_the_work_that_the_gas_takes_up(kind, exponent, area):
    step, slides, balance = 1e-6, kind == "prismatic", cylinder(exponent, area)
    behind, ahead = ([work(at + side, exponent, area, slides) for at in PLACES] for side in (-step, step))
    wanted = -(np.array(ahead) - behind) / (2 * step)
    found = balance_torque(balance, PLACES, slides=slides)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=FINITE_DIFFERENCE * np.abs(wanted).max())
    # The rigid model's motor carries the same, with the opposite sign, by way of its gear.
    robot, bare = arm(balance, kind), arm(None, kind)
    turns, still = PLACES[:, None] * robot.motor_per_arm, np.zeros((PLACES.size, 1))
    models = (build_rigid_model(each) for each in (robot, bare))
    held, free = (model.torques(model.nominal, turns, still, still)[:, 0] for model in models)
    scale = np.abs(wanted).max()
    np.testing.assert_allclose((held - free) * robot.motor_per_arm[0, 0], -found, rtol=0, atol=IDENTITY * scale)


def test_the_pull_is_that_of_the_polytropic_law():
    # Drawn out until half the volume is left, gas at a constant temperature pulls twice as much.
    drawn = np.array([FREE, FREE + 0.5 * VOLUME / AREA])
    np.testing.assert_allclose(cylinder(1.0).pull(drawn), [AREA * PRESSURE, 2 * AREA * PRESSURE], rtol=IDENTITY)
    np.testing.assert_allclose(cylinder(1.3).pull(drawn)[1], AREA * PRESSURE * 2**1.3, rtol=IDENTITY)
    with pytest.raises(DataError, match="no volume"):
        cylinder(1.3).pull(np.array([FREE + 1.1 * VOLUME / AREA]))


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize(
    "balance",
    [cylinder(1.3), SpringBalance(CARRIER, LINK, FREE, 4e3, 120.0), HarmonicBalance(np.array([3.0, 1.0]), np.ones(2))],
)
def test_slopes_are_those_of_the_torque(balance, slides):
    if slides and isinstance(balance, HarmonicBalance):
        return
    step = 1e-6
    ahead, behind = (balance_torque(balance, PLACES + side, slides=slides) for side in (step, -step))
    wanted = (ahead - behind) / (2 * step)
    found = balance_slope(balance, PLACES, slides=slides)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=FINITE_DIFFERENCE * np.abs(wanted).max())


def test_statics_carry_the_same_as_the_rigid_model():
    robot = replace(arm(cylinder(1.3)), springs=())
    model, rigid = build_model(robot, balanced=True), build_rigid_model(robot)
    turns, still = PLACES[:, None] * robot.motor_per_arm, np.zeros((PLACES.size, 1))
    wanted = rigid.torques(rigid.nominal, turns, still, still)[:, 0] * robot.motor_per_arm[0, 0]
    found = gravity_torque(model, PLACES[:, None])[:, model.arm[0]]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=IDENTITY * np.abs(wanted).max())
    with pytest.raises(DataError, match="D207"):
        build_model(robot)


@pytest.mark.parametrize("balance", [cylinder(1.3), SpringBalance(CARRIER, LINK, FREE, 4e4, 120.0)])
def test_a_moving_arm_gives_back_what_its_counterbalance_took(balance):
    robot = replace(arm(balance), springs=(), gravity_m_s2=np.zeros(3))
    links = (replace(robot.joints[0], motor=replace(robot.joints[0].motor, friction=_smooth(robot)), arm_viscous=0.0),)
    robot = replace(robot, joints=links)

    def lost(period_s):
        """Largest change of the energy, over that of the motion."""
        model = build_model(robot, timestep_s=period_s, balanced=True)
        batch = Batch(model.mujoco, 1)
        batch.qpos[:], held = 0.3, PointBalances(model, batch, period_s)
        inertia = build_rigid_model(robot)
        columns = inertia.columns(np.zeros((1, 1)), np.zeros((1, 1)), np.eye(1))
        mass = (columns @ inertia.nominal)[0, 0] - inertia.torques(inertia.nominal, *np.zeros((3, 1, 1)))[0, 0]
        mass *= robot.motor_per_arm[0, 0] ** 2
        energies, moving = [], []
        for _ in range(int(0.5 / period_s)):
            batch.qfrc_applied[:] = 0.0
            held.follow()
            batch.step(nstep=1)
            moving.append(0.5 * mass * float(batch.qvel[0, 0]) ** 2)
            energies.append(moving[-1] + _stored(balance, float(batch.qpos[0, 0])))
        assert max(moving) > 0
        return np.ptp(energies) / max(moving)

    coarse, fine = lost(2e-3), lost(5e-4)
    # Torques at the middle of a sample are of second order: a quarter of the period loses a sixteenth.
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(16, rel=0.3)


def _smooth(robot):
    return replace(robot.joints[0].motor.friction, viscous_nms_rad=0.0, coulomb_nm=0.0, static_nm=0.0)


def _stored(balance, position):
    if isinstance(balance, GasBalance):
        return work(position, balance.exponent, balance.area_m2, False)
    length = points(position, False) - FREE
    return 0.5 * balance.stiffness_n_m * length**2 + balance.preload_n * length


def test_an_identified_pressure_is_put_into_the_robot():
    robot = arm(cylinder(1.3))
    found = with_standard(robot, {"joint1.counterbalance_pressure": 4e6}).robot.joints[0].counterbalance
    assert found.rest_pressure_pa == 4e6
    assert (found.area_m2, found.exponent) == (AREA, 1.3)
    length, lever, _ = stretch(found, PLACES, slides=False)
    np.testing.assert_allclose(0.8 * balance_torque(cylinder(1.3), PLACES, slides=False), -found.pull(length) * lever)

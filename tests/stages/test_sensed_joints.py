"""Torques that sensors measure at the joints, without a motor in the equations, through the command line."""

import numpy as np
import pytest

from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, read_header
from robid.models.known import load_experiment
from robid.models.rigid.files import solution_from_artifact
from robid.robot.regressor.base import find_base_parameters
from sensed_joints import EXPERIMENT, MOTOR, ROBOT, SENSOR, write_logs

_RELATIVE = 2e-3  # of each torque's share, without noise: what filtering leaves


@pytest.fixture
def sensed(shop):
    """A folder with an arm whose joints have torque sensors, and logs of two of its motions on demand."""

    def make(first=SENSOR, noise=0.0, robot=ROBOT, experiment=EXPERIMENT):
        (shop.folder / "robot.yaml").write_text(robot.replace("TURN", first))
        (shop.folder / "e.yaml").write_text(experiment)
        loaded = load_experiment(shop.folder / "e.yaml").robot.to_robot()
        shop.model, shop.values = write_logs(shop.folder, loaded, noise)
        shop.robot = loaded
        return shop

    return make


def _solution(shop):
    return solution_from_artifact(read_artifact(shop.folder / "runs/sensed/fits/arm/model.h5", MODEL))


def _recovered(shop):
    """Estimated and true base parameters, and how far each moves its torque."""
    estimate, base = _solution(shop).estimate, find_base_parameters(shop.model)
    assert estimate.names == base.base_names
    return estimate, base.values(shop.values)


@pytest.mark.parametrize("first", [SENSOR, f"rigid: true\n    {MOTOR}"], ids=["all", "mixed"])
def test_base_parameters_come_back_on_the_side_where_they_were_measured(sensed, first):
    shop = sensed(first)
    answer = shop.robid("run", "e.yaml")
    assert answer.code == 0, answer.err
    estimate, true = _recovered(shop)
    size = np.abs(true) + estimate.relative_std.clip(max=1e-6)
    seen = estimate.identified & (np.abs(true) > 1e-3)
    assert seen.sum() > 12
    np.testing.assert_allclose(estimate.value[seen] / size[seen], true[seen] / size[seen], atol=_RELATIVE)
    assert not any("motor_inertia" in name for name in _solution(shop).base.standard if not name.startswith("turn"))
    units = dict(zip(estimate.names, estimate.units, strict=True))
    assert (units["lift.viscous"], units["slide.viscous"]) == ("N m s/rad", "N s/m")
    assert (units["slide.coulomb"], units["slide.torque_offset"]) == ("N", "N")


def test_noise_stays_within_the_intervals_and_the_robot_is_exported(sensed):
    shop = sensed(noise=0.01)
    answer = shop.robid("run", "e.yaml", "--strict")
    assert answer.code == 0, answer.err
    estimate, true = _recovered(shop)
    off = np.abs(estimate.value - true) / np.sqrt(np.diag(estimate.covariance))
    assert off.max() < 4
    assert "motor_inertia" not in " ".join(_solution(shop).base.standard)
    for kind in ("robot", "urdf", "mjcf", "json", "csv", "mat"):
        assert shop.robid("export", "e.yaml", "--format", kind).code == 0
    exported = shop.folder / "runs/sensed/fits/arm/export"
    assert "slide.coulomb" in exported.joinpath("robot.yaml").read_text().split("schema_version")[0]
    (shop.folder / "robot.yaml").write_text(exported.joinpath("robot.yaml").read_text())
    again = load_experiment(shop.folder / "e.yaml").robot.to_robot()
    assert not again.has_motors.any()
    assert again.joints[2].arm_viscous == pytest.approx(
        dict(zip(shop.model.names, shop.values, strict=True))["slide.viscous"], rel=0.1
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("name: turn.arm, variable", "name: turn, side: arm, variable"),
        ("name: turn.arm, variable", "name: turn.arm, side: arm, variable"),
        ("name: turn.arm, variable", "name: turn, variable"),
    ],
)
def test_an_arm_side_is_named_alike_for_inputs_and_outputs(sensed, old, new):
    shop = sensed()
    assert shop.robid("simulate-or-acquire", "e.yaml", "--campaign", "motion").code == 0
    before = read_header(shop.folder / "runs/sensed/motion/record.h5")
    assert EXPERIMENT.count(old) == 2  # an input and an output
    (shop.folder / "e.yaml").write_text(EXPERIMENT.replace(old, new))
    answer = shop.robid("simulate-or-acquire", "e.yaml", "--campaign", "motion", "--run-dir", "other")
    assert answer.code == 0, answer.err
    after = read_header(shop.folder / "other/motion/record.h5")
    assert before.content_sha256 == after.content_sha256


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("fits:\n", "fits:\n  k: {family: elastic, from: motion}\n", "fits.k.family"),
        ("fits:\n", "designs: {chosen: {campaign: motion, count: 2}}\nfits:\n", "designs.chosen"),
        (
            "fits:\n",
            "  sim: {configurations: {list_deg: [[0, 0, 0]]}, source: {simulate: {}}}\nfits:\n",
            "campaigns.sim.source.simulate",
        ),
        ("filters: {", "estimator: instruments, filters: {", "fits.arm.estimator"),
    ],
)
def test_what_needs_motors_says_so_in_status(sensed, old, new, field):
    shop = sensed()
    (shop.folder / "e.yaml").write_text(EXPERIMENT.replace(old, new, 1))
    answer = shop.robid("status", "e.yaml")
    assert answer.code == 2, answer.err
    assert field in answer.flat
    assert "`turn`" in answer.flat
    assert "`slide`" in answer.flat


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("TURN", "rigid: true", "joints[1].motor"),
        ("TURN", f"{MOTOR}\n    {SENSOR}", "joints[1].motor"),
        ("TURN", f"{SENSOR}\n    couplings: {{lift: 0.01}}", "joints[1].couplings"),
        ("TURN", f"rigid: true\n    {MOTOR}\n    couplings: {{lift: 0.01}}", "joints[1].couplings.lift"),
        ("TURN", f"{SENSOR}\n    gear: {{stiffness_nm_rad: 1e4, damping_nms_rad: 1}}", "joints[1].gear"),
    ],
)
def test_a_robot_file_that_contradicts_its_sensors_is_refused(sensed, old, new, field):
    shop = sensed()
    (shop.folder / "robot.yaml").write_text(ROBOT.replace(old, new))
    answer = shop.robid("status", "e.yaml")
    assert answer.code == 2, answer.err
    assert f"{field}: " in answer.flat


def test_a_sensor_behind_a_gear_that_is_not_stated_is_named_first(sensed):
    shop = sensed(noise=0.01)
    motor = "rigid: true\n    motor: {inertia_kgm2: 2.0e-4, gear_ratio_rad_m: 200}"
    head, _, last = ROBOT.replace("TURN", SENSOR).rpartition(SENSOR)
    (shop.folder / "robot.yaml").write_text(head + motor + last)
    answer = shop.robid("run", "e.yaml")
    assert answer.code == 5, answer.err
    first = answer.flat.partition("Look first for ")[2]
    assert SENSOR in first.partition(".")[0], answer.flat
    (shop.folder / "robot.yaml").write_text(ROBOT.replace("TURN", SENSOR))
    assert shop.robid("run", "e.yaml").code == 0

"""What a rigid fit hands on as robots: its payload, its Coulomb friction left out, and how far it may be off."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.handed_on import RigidSource, Standard, standard_robot
from robid.models.known import load_experiment
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model

STAGES = Path(__file__).parents[2] / "stages"


@pytest.fixture(scope="module")
def loaded():
    return load_experiment(STAGES / "payload.yaml")


def standard_of(loaded, payload="body", spread=0.01, friction="coulomb"):
    """Everything a tenth heavier than the file, with independent errors of a share of each value."""
    model = build_rigid_model(loaded.robot.to_robot(8.0), RigidOptions(payload=payload, friction=friction))
    value = 1.1 * model.nominal + 0.3 * np.array([kind == "coulomb" for kind in model.kinds])
    return Standard(model.names, model.units, value, np.diag((spread * value) ** 2), "estimated")


def source_of(loaded, **how):
    return RigidSource(loaded, "carried", standard_of(loaded, **how), 8.0)


def test_a_robot_has_the_fits_masses_and_the_files_coulomb_friction(loaded):
    source = source_of(loaded)
    robot, file = source.robot(8.0), loaded.robot.to_robot(8.0)
    for ours, theirs in zip(robot.joints, file.joints, strict=True):
        assert ours.link.mass_kg == pytest.approx(1.1 * theirs.link.mass_kg)
        assert ours.motor.inertia_kgm2 == pytest.approx(1.1 * theirs.motor.inertia_kgm2)
        assert ours.motor.friction.viscous_nms_rad == pytest.approx(1.1 * theirs.motor.friction.viscous_nms_rad)
        assert ours.motor.friction.coulomb_nm == theirs.motor.friction.coulomb_nm
    exported = standard_robot(loaded, "carried", source.standard).robot
    assert [joint.motor.friction.coulomb_nm for joint in exported.joints] == pytest.approx([0.3] * 3)
    assert [joint.motor.friction.relative_std for joint in exported.joints] == pytest.approx([0.01] * 3)


@pytest.mark.parametrize("payload", ["body", "link"])
def test_payloads_of_other_masses_have_the_same_shape(loaded, payload):
    source = source_of(loaded, payload=payload)
    own, half, none = (source.robot(mass) for mass in (8.0, 4.0, 0.0))
    assert own.payload.mass_kg == pytest.approx(8.8 if payload == "body" else 8.0)
    assert half.payload.mass_kg == pytest.approx(0.5 * own.payload.mass_kg)
    np.testing.assert_allclose(half.payload.inertia_kgm2, 0.5 * own.payload.inertia_kgm2)
    assert none.payload.mass_kg == 0.0
    # As a part of the link the payload is the file's, and what is more is the link's.
    more = 1.1 * 6.0 if payload == "body" else 1.1 * 14.0 - 8.0
    assert none.joints[-1].link.mass_kg == pytest.approx(more)


def test_a_link_that_cannot_be_without_the_payload_serves_this_payload_alone(loaded):
    standard = standard_of(loaded, payload="link")
    light = np.where([name.startswith("elbow.") for name in standard.names], 0.4, 1.0) * standard.value
    source = RigidSource(loaded, "carried", replace(standard, value=light), 8.0)
    robot = source.robot(8.0)
    assert robot.payload.mass_kg == 0
    assert robot.joints[-1].link.mass_kg == pytest.approx(0.4 * 1.1 * 14.0)
    with pytest.raises(DataError, match="leave no real body without the robot file's payload of 8 kg"):
        source.robot(4.0)


def test_directions_hold_the_covariance_of_what_an_elastic_robot_has(loaded):
    source = source_of(loaded)
    directions = np.array(source.directions())
    assert len(directions) < len(source.standard.names)
    held = directions.T @ directions
    rigid = np.array([not name.endswith(("coulomb", "torque_offset")) for name in source.standard.names])
    wanted = np.where(np.outer(rigid, rigid), source.standard.covariance, 0.0)
    assert not held[~rigid].any()
    strong = np.argsort(np.diag(wanted) / np.maximum(source.standard.value**2, 1e-12))[-3:]
    assert np.trace(held) <= np.trace(wanted) * (1 + 1e-9)
    np.testing.assert_allclose(np.diag(held)[strong], np.diag(wanted)[strong], rtol=0.05)


def test_doubtful_robots_are_real_and_off_by_what_they_say(loaded):
    source = source_of(loaded)
    directions, found = source.directions(), source.perturbed(8.0)
    assert len(found) == len(directions)
    options = RigidOptions(payload="body", friction="viscous", offsets=False)
    at = [source.standard.names.index(name) for name in build_rigid_model(source.robot(8.0), options).names]
    centre = build_rigid_model(source.robot(8.0), options).nominal
    for direction, (robot, deviations) in zip(directions, found, strict=True):
        moved = build_rigid_model(robot, options).nominal - centre
        np.testing.assert_allclose(moved, deviations * direction[at], rtol=1e-6, atol=1e-9)
        assert 0 < abs(deviations) <= 0.1

"""Robot files with other values: what is written loads again as the robot that was meant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.robot.inertia import about_origin
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from robid.settings.robot_values import robot_text, with_values

ROBOTS = Path(__file__).parents[3] / "configs" / "robots"
NAMES = ["kr300", "branch", "gantry", "emps"]


def other(robot):
    """The robot with everything heavier by a fifth, and more friction."""

    def heavier(body):
        return replace(body, mass_kg=1.2 * body.mass_kg, inertia_kgm2=1.2 * body.inertia_kgm2)

    def changed(joint):
        law = joint.motor.friction
        more = replace(
            law, viscous_nms_rad=law.viscous_nms_rad + 1e-3, coulomb_nm=2 * law.coulomb_nm, static_nm=2 * law.static_nm
        )
        motor = replace(joint.motor, inertia_kgm2=1.3 * joint.motor.inertia_kgm2, friction=more)
        return replace(joint, link=heavier(joint.link), motor=motor)

    springs = tuple(
        spring if spring.outboard is None else replace(spring, outboard=heavier(spring.outboard))
        for spring in robot.springs
    )
    loops = tuple(replace(link, link=heavier(link.link)) for link in robot.loop_links)
    joints = tuple(changed(joint) for joint in robot.joints)
    return replace(robot, joints=joints, payload=heavier(robot.payload), springs=springs, loop_links=loops)


@pytest.mark.parametrize("name", NAMES)
def test_a_written_file_loads_as_the_robot(name, tmp_path):
    file = load_robot(ROBOTS / f"{name}.yaml")
    wanted = other(file.to_robot())
    path = tmp_path / "robot.yaml"
    path.write_text(robot_text(with_values(file, wanted), "a header\nof two lines"))
    assert path.read_text().startswith("# a header\n# of two lines\nschema_version: 2\n")
    found = load_robot(path).to_robot()
    models = build_rigid_model(found), build_rigid_model(wanted)
    np.testing.assert_allclose(models[0].nominal, models[1].nominal, rtol=1e-12, atol=1e-12)
    assert [spring.name for spring in found.springs] == [spring.name for spring in wanted.springs]
    for ours, theirs in zip(found.springs, wanted.springs, strict=True):
        assert (ours.stiffness, ours.damping) == (theirs.stiffness, theirs.damping)
        if ours.outboard is not None:
            np.testing.assert_allclose(about_origin(ours.outboard), about_origin(theirs.outboard), rtol=1e-12)
    assert [(joint.lower, joint.upper) for joint in found.joints] == [(j.lower, j.upper) for j in wanted.joints]
    assert [j.motor.friction.static_nm for j in found.joints] == [j.motor.friction.static_nm for j in wanted.joints]


def test_what_stays_is_still_assumed_and_what_changes_is_not():
    file = load_robot(ROBOTS / "puma560.yaml")
    assumed = file.to_robot().assumed
    assert with_values(file, file.to_robot()).to_robot().assumed == assumed
    left = with_values(file, other(file.to_robot())).to_robot().assumed
    assert set(left) < set(assumed)
    changed = [name for name in assumed if "inertia_kgm2" in name or name.endswith("static_nm")]
    assert changed
    assert not set(changed) & set(left)
    assert "axis_1.limits_deg" in left

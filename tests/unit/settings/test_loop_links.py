"""Links of closed loops in a robot file: from the frames of its links to joint frames."""

import numpy as np

from robid.robot.inertia import turn_about
from robid.settings.robot import LoopLinkSection
from robid.settings.robot_sections import JointSection

BODY = {"mass_kg": 1, "com_m": [0.1, 0, 0], "inertia_kgm2": {"xx": 0.1, "yy": 0.1, "zz": 0.1}}
DRIVE = {"inertia_kgm2": 1e-3, "gear_ratio": 100}


def joint(name):
    return JointSection.model_validate({"name": name, "dh": {"a_m": 0.2, "d_m": 0.5, "alpha_deg": 90}, "motor": DRIVE})


def loop_link(**settings):
    section = LoopLinkSection.model_validate({"name": "crank", "turns": {"two": 1}, "link": BODY, **settings})
    return section.loop_link([joint("one"), joint("two")], turn_about("x", 180))


def test_frames_and_pins_are_those_of_the_links():
    pin = {"point_m": [0, 0, 0.3], "joint": "two", "held_point_m": [0, 0.1, 0]}
    found = loop_link(parent="one", frame={"position_m": [0.1, 0, 0]}, offset_deg=90, pin=pin)
    # A link's frame lies at the end of its DH transformation, its y axis along the joint's z.
    np.testing.assert_allclose(found.position_m, [0.3, 0, 0.5])
    np.testing.assert_allclose(found.rotation, turn_about("x", 90), atol=1e-15)
    assert (found.pin.joint, found.offset_rad) == (1, np.pi / 2)
    np.testing.assert_allclose(found.pin.point_m, [0, 0, 0.3])
    np.testing.assert_allclose(found.pin.held_point_m, [0.2, 0, 0.6], atol=1e-15)


def test_other_loop_links_and_the_base_have_their_own_frames():
    np.testing.assert_allclose(loop_link(parent="rod", frame={"position_m": [0.1, 0.2, 0]}).position_m, [0.1, 0.2, 0])
    on_base = loop_link(frame={"position_m": [0.1, 0.2, 0]})
    np.testing.assert_allclose(on_base.position_m, [0.1, -0.2, 0], atol=1e-15)
    np.testing.assert_allclose(on_base.rotation, turn_about("x", 180), atol=1e-15)

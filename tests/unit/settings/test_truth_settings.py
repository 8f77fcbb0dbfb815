"""The truth in an experiment file: what it changes, and which names and values it refuses."""

import numpy as np
import pytest

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.settings.sources import true_robot_of

JOINT = """
  - name: {name}
    dh: {{d_m: 0.4, a_m: 0.8, alpha_deg: 90}}
    limits_deg: [-150, 150]
    link: {{mass_kg: 30, com_m: [-0.3, 0, 0], inertia_kgm2: {{xx: 1.5, yy: 1.2, zz: 1.4}}}}
    gear: {{stiffness_nm_rad: 1.5e+5, damping_nms_rad: 80}}
    motor: {{inertia_kgm2: 0.002, gear_ratio: 100, max_speed_rad_s: 400, max_torque_nm: 30}}"""
ROBOT = f"""schema_version: 1
name: arm
controller: {{}}
joints:{JOINT.format(name="turn")}{JOINT.format(name="lift")}
"""
PAYLOAD = "payload: {mass_kg: 5, com_m: [0, 0, 0], inertia_kgm2: {xx: 0.05, yy: 0.05, zz: 0.05}}\n"
SPRINGS = """springs:
            - {name: tilt, place: base, axis: [0, 2, 0], stiffness_nm_rad: 1.0e+6, damping_nms_rad: 300}
            - name: forearm
              joint: lift
              place: split
              axis: [1, 0, 0]
              point_m: [-0.4, 0, 0]
              stiffness_nm_rad: 2.0e+5
              damping_nms_rad: 20
              outboard: {mass_kg: 12, com_m: [-0.2, 0, 0], inertia_kgm2: {xx: 0.3, yy: 0.25, zz: 0.3}}
"""


def write(folder, simulate, robot=ROBOT + PAYLOAD, payload=""):
    (folder / "robot.yaml").write_text(robot)
    path = folder / "experiment.yaml"
    path.write_text(f"""schema_version: 1
name: truth
robot: robot.yaml
campaigns:
  measured:{payload}
    configurations: {{list_deg: [[10, 20]]}}
    source:
      simulate:
        {simulate}
""")
    return path


def refused(path):
    with pytest.raises(SettingsError) as caught:
        load_experiment(path)
    return caught.value.what


def test_springs_that_the_robot_file_lacks_are_in_the_true_robot_alone(tmp_path):
    loaded = load_experiment(write(tmp_path, f"truth:\n          {SPRINGS}"))
    truth = loaded.experiment.campaigns["measured"].source.simulate.truth
    true = true_robot_of(loaded.robot, None, truth)
    assert [spring.name for spring in loaded.robot.to_robot().springs] == ["gear_turn", "gear_lift"]
    assert [spring.name for spring in true.springs] == ["gear_turn", "gear_lift", "tilt", "forearm"]
    np.testing.assert_allclose(true.springs[2].axis, [0, 1, 0])
    # A split is written in the link's frame, which alpha turns and a and d move.
    np.testing.assert_allclose(true.springs[3].point_m, [0.4, 0, 0.4], atol=1e-12)
    assert true.springs[3].outboard.mass_kg == 12


@pytest.mark.parametrize(
    ("simulate", "words"),
    [
        ("truth: {rotor_inertia_factor: {tern: 1.02}}", "no joint `tern`; did you mean `turn`?"),
        ("truth: {rotor_inertia_factor: {turn: 0}}", "must be above 0"),
        ("truth: {mass_factor: {lifd: 1.02}}", "no body `lifd`; did you mean `lift`?"),
        ("truth: {mass_factor: {base: 2}}", "no body `base`"),
        ("truth: {inertia_factor: {lifd: 1.02}}", "no body `lifd`; did you mean `lift`?"),
        ("truth: {mass_relative: [0.05, 0.03]}", "S135"),
        ("truth: {couplings: {lift: {tern: 0.001}}}", "no joint `tern`; did you mean `turn`?"),
        ("truth: {couplings: {lift: {lift: 0.001}}}", "S137"),
        ("truth: {counterbalance_nm: {lifd: [1, 2]}}", "no revolute joint `lifd` without a counterbalance"),
        (
            "truth: {zero_deg: {lifd: -1}}",
            "zero_deg.lifd: S429 there is no revolute joint `lifd`; did you mean `lift`?",
        ),
        ("truth: {late_torque_s: {lifd: 0.001}}", "late_torque_s.lifd: S514 there is no joint `lifd`"),
        ("truth: {late_angle_s: {lift: -0.001}}", "late_angle_s.lift: S515 must be 0 or above"),
        ("imperfections: {load_friction: 0.1}", "S139"),
        ("truth: {torque_constant_factor: {turn: -1}}", "must be above 0"),
        ("truth: {torque_constant_factor: {axis: 1.1}}", "no joint `axis`"),
        ("truth: {reversed_torque: [lift, lifd]}", "reversed_torque[2]: S134 there is no joint `lifd`"),
        ("truth: {keep: [gear_tern]}", "did you mean `gear_turn`?"),
        (f"truth:\n          {SPRINGS}".replace("name: tilt", "name: gear_lift"), "S254"),
        (f"truth:\n          {SPRINGS}".replace("joint: lift", "joint: lifd"), "no joint `lifd`"),
        (f"truth:\n          {SPRINGS}".replace("mass_kg: 12", "mass_kg: 31"), "S283 must be below the 30 kg"),
        (f"truth:\n          {SPRINGS}".replace("axis: [0, 2, 0], ", ""), "springs[1].axis: S276"),
        (
            "truth: {springs: [{name: x, joint: lift, place: transmission, stiffness_nm_rad: 1, damping_nms_rad: 1}]}",
            "S140",
        ),
        ("imperfections: {unmodelled_payload_kg: -6}", "S142 the payload has 5 kg"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path, simulate, words):
    told = refused(write(tmp_path, simulate))
    assert words in told
    assert "campaigns.measured.source.simulate." in told


@pytest.mark.parametrize(("robot", "payload"), [(ROBOT, ""), (ROBOT + PAYLOAD, "\n    payload_kg: 0")])
def test_a_robot_without_payload_cannot_carry_an_unmodelled_one(tmp_path, robot, payload):
    path = write(tmp_path, "imperfections: {unmodelled_payload_kg: 2}", robot, payload)
    assert "S141" in refused(path)


def test_all_of_the_payload_may_be_missing(tmp_path):
    assert load_experiment(write(tmp_path, "imperfections: {unmodelled_payload_kg: -5}"))


def test_gears_are_one_sided_or_follow_a_joint(tmp_path):
    law = "stiffness_over: {joint: turn, positions_deg: [-150, 150], factors: [1, 0.8]}"
    robot = ROBOT.replace("damping_nms_rad: 80}", f"damping_nms_rad: 80, {law}}}", 1)
    told = refused(write(tmp_path, "imperfections: {one_sided: 0.1}", robot))
    assert "imperfections.one_sided: S516 the stiffness of `gear_turn`" in told
    assert load_experiment(write(tmp_path, "imperfections: {one_sided: 0.1}"))


@pytest.mark.parametrize("flaw", ["transmission_error_rad: [1.0e-5]", "gear_error_rad: 1.0e-5"])
def test_gears_have_errors_or_follow_a_joint(tmp_path, flaw):
    law = "stiffness_over: {joint: turn, positions_deg: [-150, 150], factors: [1, 0.8]}"
    robot = ROBOT.replace("damping_nms_rad: 80}", f"damping_nms_rad: 80, {law}}}", 1)
    told = refused(write(tmp_path, f"imperfections: {{{flaw}}}", robot))
    assert f"imperfections.{flaw.split(':')[0]}: S630 the stiffness of `gear_turn`" in told
    assert load_experiment(write(tmp_path, f"imperfections: {{{flaw}}}"))


def test_every_phase_of_an_error_has_its_amplitude(tmp_path):
    flaws = "imperfections: {transmission_error_rad: [1.0e-5], transmission_error_phase_rad: [1, 2]}"
    assert "transmission_error_phase_rad: S631 has 2 phases" in refused(write(tmp_path, flaws))
    assert load_experiment(write(tmp_path, flaws.replace("[1, 2]", "[1]")))

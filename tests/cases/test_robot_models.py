"""Robot models that were read wrong in silence, or refused with messages that led nowhere."""

import re

import pytest
from ruamel.yaml import YAML


def change(path, old, new, count=1):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


def add(path, more):
    path.write_text(f"{path.read_text()}\n{more}\n")


def loop_links(told):
    """The entry that a message tells to add."""
    return re.search(r"`(loop_links: \[.*?\}\])`", told)[1]


@pytest.fixture
def mimic(case):
    """The palletizer's URDF, whose levelled wrist follows the elbow."""
    found = case("rigid_mimic")
    text = (found.folder / "rob_loop.yaml").read_text().partition("loop_links:")[0]
    (found.folder / "rob_locked.yaml").write_text(text.replace("nowrist.urdf", "mimic.urdf"))
    return found


@pytest.mark.parametrize("more", ["", "locked_deg: {level: 0}", "locked: rest"])
def test_a_joint_that_follows_a_driven_one_is_refused_by_name(mimic, more):
    add(mimic.folder / "rob_locked.yaml", more)
    answer = mimic.robid("status", "exp_locked.yaml")
    assert answer.code == 2
    for name in ("`level`", "`j3`", "loop_links"):
        assert name in answer.flat


def test_the_loop_link_that_is_told_gives_the_right_robot(mimic):
    told = mimic.robid("status", "exp_locked.yaml").flat
    add(mimic.folder / "rob_locked.yaml", loop_links(told))
    answer = mimic.robid("run", "exp_locked.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = YAML(typ="safe").load((mimic.folder / "runs/mimic_locked/summary.json").read_text())
    assert summary["fits.arm.parameters.j3.MX.estimate"] == pytest.approx(48, abs=0.4)
    assert summary["fits.arm.parameters.j3.motor_inertia.estimate"] == pytest.approx(1e-3, rel=0.1)


def test_gravity_of_an_mjcf_is_taken_and_told(case):
    wall = case("mjcf_gravity")
    taken, stated = (wall.robid("run", name, "--json") for name in ("exp.yaml", "exp_g.yaml"))
    assert (taken.code, stated.code) == (0, 0)
    told = wall.robid("run", "exp.yaml").flat
    for words in ("gravity", "gravcomp", "armature", "frictionloss"):
        assert words in told
    found = [
        YAML(typ="safe").load((wall.folder / f"runs/{name}/summary.json").read_text())[
            "fits.arm.parameters.j2.MX.estimate"
        ]
        for name in ("wall", "wall_g")
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("e_tri.yaml", ["`l2`", "principal moments", "model"]),
        ("e_tri_balance.yaml", ["`l2`", "principal moments", "balanceinertia"]),
        ("e_zeroM.yaml", ["`l2`", "no mass"]),
        ("e_limswap.yaml", ["joints[1].limits_deg", "`j1`", "exchanged"]),
        ("e_revlim0.yaml", ["joints[1].limits_deg", "`j1`", "both limits are 0"]),
        ("e_xacro.yaml", ["xacro", "expanded"]),
    ],
)
def test_details_of_a_urdf_are_named_for_what_they_are(case, capfd, name, words):
    arm = case("urdf_details")
    answer = arm.robid("status", name)
    assert answer.code == 2
    for word in words:
        assert word in answer.flat
    assert "is missing" not in answer.flat
    assert not list(arm.folder.rglob("MUJOCO_LOG.TXT"))
    assert "WARNING" not in "".join(capfd.readouterr())


def test_all_links_and_joints_of_a_urdf_are_told_in_one_round(case):
    arm = case("urdf_details")
    path = arm.folder / "tri.urdf"
    change(path, '<mass value="10"/>', '<mass value="10,0"/>')
    change(path, 'lower="-3" upper="3"', 'lower="3" upper="-3"')
    change(path, '<link name="tool"><inertial><origin xyz="0 0.05 0.1" rpy="0.7 0 -0.9"/><mass value="2"/>',
           '<link name="tool"><inertial><origin xyz="0 0.05 0.1" rpy="0.7 0 -0.9"/><mass value="0"/>')  # fmt: skip
    told = arm.robid("status", "e_tri.yaml").err
    for name in ("`l1`", "`l2`", "`tool`", "`j1`"):
        assert name in told


@pytest.mark.parametrize("name", ["e.yaml", "e_el.yaml", "e_near.yaml"])
def test_motors_that_turn_the_same_combination_are_both_named(case, name):
    answer = case("singular_coupling").robid("status", name)
    assert answer.code == 2
    for words in ("`j2`", "`j3`", "S253", "signs"):
        assert words in answer.flat


def test_a_differential_with_its_minus_is_sound(case):
    wrist = case("singular_coupling")
    for name in ("robot.yaml", "robot_el.yaml"):
        change(wrist.folder / name, "gear_ratio: 100", "gear_ratio: -100", count=2)
        change(wrist.folder / name, "gear_ratio: -100", "gear_ratio: 100")
    for name in ("e.yaml", "e_el.yaml"):
        assert wrist.robid("status", name).code == 0


def test_an_axis_that_is_all_rotor_is_asked_for_its_share(case):
    bench = case("massless_axis")
    answer = bench.robid("status", "e.yaml")
    assert answer.code == 2
    assert "joints[1].link.inertia_kgm2" in answer.flat
    share = re.search(r"`inertia_kgm2: (\{.*?\})`", answer.flat)[1]
    change(bench.folder / "robot.yaml", "{xx: 0, yy: 0, zz: 0}", share)
    change(bench.folder / "robot.yaml", "inertia_kgm2: 2.0e-4", "inertia_kgm2: 1.0e-4")
    assert bench.robid("status", "e.yaml").code == 0

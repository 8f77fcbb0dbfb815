"""All that is wrong with two files is told in one round, and a mistake in an anchored section once."""

import itertools
from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.settings.load import load_robot

ROBOT = """schema_version: 2
name: arm
controller: {sampling_period_s: 1.0e-3}
joints:
  - &joint
    name: one
    dh: {}
    limits_deg: [-90, 90]
    link: {mass_kg: 1, com_m: [0, 0, 0], inertia_kgm2: {xx: 1, yy: 1, zz: 1}}
    motor: {inertia_kgm2: 1.0e-3, gear_ratio: 100, max_speed_rad_s: 300, max_torque_nm: 10}
    gear: {stiffness_nm_rad: 1.0e+5, damping_nms_rad: 10}
  - {<<: *joint, name: two, limits_deg: [-45, 45], counterbalance: {sine_nm: [1.0]}}
sensors: [{name: nose, kind: tracker, axis: [0, 0, 1]}]
"""
EXPERIMENT = """schema_version: 2
name: test
robot: robot.yaml
campaigns:
  candidates:
    configurations: {random: {count: 5, seed: 1}}
    excitation: &excitation {period_s: 2, low_hz: 1, high_hz: 50, count: 20}
  measured:
    configurations: {from: best}
    excitation: *excitation
    source: &source {simulate: {seed: 1}}
  fresh:
    configurations: {list_deg: [[10, 20], [-80, 40]]}
    excitation: {<<: *excitation, seed: 2}
    periods: 2
    source: *source
designs:
  best: {campaign: candidates, count: 3}
fits:
  springs: {family: elastic, from: measured, validate_on: fresh}
execution: {workers: 2}
"""

MISTAKES = [
    ("seed: 2", "sed: 2", "S380"),
    ("periods: 2", "periods: many", "campaigns.fresh.periods: S383"),
    ("workers: 2", "workers: 0", "execution.workers: S383"),
    ("from: measured", "from: measurd", "fits.springs.from: S177"),
    ("campaign: candidates", "campaign: nowhere", "designs.best.campaign: S155"),
    ("[-80, 40]]", "[-80]]", "campaigns.fresh.configurations.list_deg[2]: S170"),
    ("gear_ratio: 100", "gear_ratio: much", "joints[1].motor.gear_ratio: S383"),
    ("sine_nm: [1.0]", "sine_nn: [1.0]", "joints[2].counterbalance.sine_nn: S380"),
    ("limits_deg: [-90, 90]", "limits_deg: [90, -90]", "joints[1].limits_deg: S255"),
    ("axis: [0, 0, 1]", "axis: [0, 0, 0]", "sensors[1].axis: S291"),
]
TOUCHED = {("gear_ratio: 100", "limits_deg: [-90, 90]")}
"""Of one joint: what a wrong type leaves unknown of it is not told."""


@pytest.fixture
def refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def load(*changes):
        experiment, robot = EXPERIMENT, ROBOT
        for old, new in changes:
            assert (old in experiment) != (old in robot), old
            experiment, robot = experiment.replace(old, new, 1), robot.replace(old, new, 1)
        Path("experiment.yaml").write_text(experiment)
        Path("robot.yaml").write_text(robot)
        with pytest.raises(SettingsError) as caught:
            load_experiment(Path("experiment.yaml"))
        return caught.value.what.splitlines()

    return load


@pytest.mark.parametrize("pair", [*itertools.combinations(MISTAKES, 2)], ids=lambda pair: f"{pair[0][2]}-{pair[1][2]}")
def test_two_mistakes_are_told_at_once_and_nothing_else(refused, pair):
    (old, new, first), (other, another, second) = pair
    told = refused((old, new), (other, another))
    if (old, other) in TOUCHED:
        assert first in "\n".join(told)
        return
    assert first in "\n".join(told)
    assert second in "\n".join(told)
    assert len(told) == 2


def test_many_mistakes_are_told_at_once(refused):
    chosen = [one for one in MISTAKES if one[0] != "limits_deg: [-90, 90]"]
    told = "\n".join(refused(*((old, new) for old, new, _ in chosen)))
    assert [text for _, _, text in chosen if text not in told] == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # The default that takes the place of a wrong value gives no complaint of its own.
        ([("count: 20", "count: many"), ("high_hz: 50", "high_hz: 20")], "excitation.count: S383"),
        ([("list_deg: [[10, 20], [-80, 40]]", "list_dg: [[10, 20]]")], "list_dg: S380"),
        ([("controller: {sampling_period_s: 1.0e-3}", "controler: {sampling_period_s: 1.0e-3}")], "controler: S380"),
        ([("{name: nose, kind: tracker, axis: [0, 0, 1]}", "nose")], "sensors[1]: S383"),
        ([("campaign: candidates, count: 3", "campain: candidates, count: 3")], "campain: S380"),
    ],
)
def test_what_follows_from_a_wrong_type_is_not_told(refused, changes, words):
    (told,) = refused(*changes)
    assert words in told


@pytest.mark.parametrize(
    ("old", "new", "place", "places"),
    [
        (
            "period_s: 2",
            "periods_s: 2",
            "experiment.yaml:7: campaigns.candidates.excitation.periods_s",
            "2 more places",
        ),
        ("count: 20", "count: many", "experiment.yaml:7: campaigns.candidates.excitation.count", "2 more places"),
        ("count: 20", "count: 60", "experiment.yaml:7: campaigns.candidates.excitation", "2 more places"),
        ("seed: 1}}\n  fresh", "sead: 1}}\n  fresh", "experiment.yaml:11: campaigns.measured.source", "1 more place "),
        ("gear_ratio: 100", "gear_ratio: 0", "robot.yaml:10: joints[1].motor.gear_ratio", "1 more place "),
        ("gear_ratio: 100, ", "", "robot.yaml:10: joints[1].motor.gear_ratio", "1 more place "),
        (", damping_nms_rad: 10", "", "robot.yaml:11: joints[1].gear.damping_nms_rad", "1 more place "),
    ],
)
def test_a_mistake_in_an_anchored_section_is_told_once(refused, old, new, place, places):
    (told,) = refused((old, new))
    assert told.startswith(f"{place}")
    assert f"(and in {places}" in told


def test_a_joint_does_not_lack_a_transmission_whose_section_is_wrong(refused):
    spring = "{{name: g{0}, joint: {1}, place: transmission, stiffness_nm_rad: 1.0e+5, damping_nms_rad: 10}}"
    springs = f"springs: [{spring.format(1, '[one]')}, {spring.format(2, 'two')}]"
    gear = "    gear: {stiffness_nm_rad: 1.0e+5, damping_nms_rad: 10}\n"
    (told,) = refused((gear, ""), ("sensors:", f"{springs}\nsensors:"))
    assert "springs[1].joint: S383" in told


def test_the_same_mistake_in_two_sections_is_told_twice(refused):
    told = refused(
        ("seed: 2", "rms: 0"), ("count: 20}", "count: 20}\n    payload_kg: -1"), ("periods: 2", "payload_kg: -1")
    )
    assert [text.split(": ")[1] for text in told] == [
        "campaigns.candidates.payload_kg",
        "campaigns.fresh.excitation.rms",
        "campaigns.fresh.payload_kg",
    ]


def test_an_anchor_that_is_not_there_and_a_key_twice_are_told_with_their_line(refused, tmp_path):
    (told,) = refused(("excitation: *excitation", "excitation: *excitatoin"))
    assert "undefined alias" in told
    with pytest.raises(SettingsError) as caught:
        load_experiment(tmp_path / "experiment.yaml")
    assert caught.value.where.endswith("experiment.yaml:10")
    assert "`*excitation`" in caught.value.remedy
    (told,) = refused(("periods: 2", "periods: 2\n    periods: 3"))
    assert "duplicate key" in told
    with pytest.raises(SettingsError) as caught:
        load_experiment(tmp_path / "experiment.yaml")
    assert caught.value.where.endswith("experiment.yaml:16")


@pytest.mark.parametrize(
    ("old", "new"), [("sensors: [", "zzzzz: 1\nsensors: ["), ("period_s: 2", "period_s: 2, qqqqqqq: 1")]
)
def test_a_key_like_no_other_is_told_in_a_line_that_can_be_read(refused, old, new):
    (told,) = refused((old, new))
    assert "S380 unknown key; known here: `" in told
    assert len(told) < 300


def test_a_mistake_in_every_joint_is_told_once_with_the_others(tmp_path):
    joint = ROBOT[ROBOT.index("  - &joint") : ROBOT.index("  - {<<")].replace("&joint\n    ", "")
    joints = "".join(joint.replace("name: one", f"name: j{number}") for number in range(1, 8))
    head, tail = ROBOT[: ROBOT.index("  - &joint")], "sensors: []\n"
    (tmp_path / "robot.yaml").write_text(head + joints.replace("gear_ratio:", "gear_ration:") + tail)
    with pytest.raises(SettingsError) as refused:
        load_robot(tmp_path / "robot.yaml")
    lines = refused.value.what.splitlines()
    assert len(lines) == 1
    assert "joints[1].motor.gear_ration" in lines[0]
    assert "`joints[2].motor.gear_ration`" in lines[0]
    assert "and 3 more" in lines[0]
    first = next(at for at, row in enumerate((head + joints).splitlines(), 1) if "gear_ratio" in row)
    assert lines[0].startswith(f"{tmp_path / 'robot.yaml'}:{first}:")

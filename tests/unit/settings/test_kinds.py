"""Units of channels against the kinds of their joints."""

import re
from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.models.known import load_experiment

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOT = """schema_version: 1
name: r
joints:
  - name: turn
    rigid: true
    frame: {}
    limits_deg: [-90, 90]
    link: &link {mass_kg: 10, com_m: [0, 0.1, 0.1], inertia_kgm2: {xx: 0.3, yy: 0.3, zz: 0.2}}
    motor: {inertia_kgm2: 2.0e-4, gear_ratio: 60}
  - name: screw
    type: prismatic
    rigid: true
    frame: {}
    limits_m: [-1, 1]
    link: *link
    motor: {inertia_kgm2: 2.0e-4, gear_ratio_rad_m: 300}
  - {name: linear, type: prismatic, rigid: true, frame: {}, limits_m: [-1, 1], link: *link,
    motor: {inertia_kgm2: 1.0e-6, gear_ratio_rad_m: -1}}
  - {name: felt, frame: {}, limits_deg: [-90, 90], link: *link, torque_measured_at: joint}
  - {name: pushed, type: prismatic, frame: {}, limits_m: [-1, 1], link: *link, torque_measured_at: joint}
"""
USUAL = {
    "turn": ("N m", "rad"),
    "screw": ("N m", "rad"),
    "linear": ("N", "m"),
    "felt": ("N m", "rad"),
    "pushed": ("N", "m"),
}


def _load(tmp_path, key, name, unit, more=""):
    """Loads an experiment with one channel of all joints changed."""
    channels = {"inputs": {}, "outputs": {}, "references": {}}
    for joint, (drive, move) in USUAL.items():
        channels["inputs"][joint] = f"{{name: {joint}, variable: u_{joint}, unit: {drive}}}"
        channels["outputs"][joint] = f"{{name: {joint}, variable: q_{joint}, unit: {move}}}"
    joint = name.partition(".")[0]
    channels[key][joint] = f"{{name: {name}, variable: changed, unit: {unit}{more}}}"
    lists = "".join(f"{one}: [{', '.join(own.values())}], " for one, own in channels.items())
    acquire = f"{{file: log.csv, sampling_period_s: 0.001, one_shot: true, {lists}}}"
    text = f"schema_version: 1\nname: e\nrobot: r.yaml\ncampaigns: {{log: {{source: {{acquire: {acquire}}}}}}}\n"
    (tmp_path / "r.yaml").write_text(ROBOT)
    (tmp_path / "e.yaml").write_text(text)
    load_experiment(tmp_path / "e.yaml")


def _refused(tmp_path, key, name, unit, more=""):
    """Fields that are refused where one channel of all joints is changed."""
    try:
        _load(tmp_path, key, name, unit, more)
    except SettingsError as error:
        return re.findall(r"acquire\.(\w+)\[\d+\]\.unit: S\d{3} `changed` is (?:in ([^,]+), but|a current)", error.what)
    return []


TURNS, SLIDES = ("rad", "deg", "rpm", "rad/s", "deg/s^2"), ("m", "mm", "m/s", "mm/s", "m/s^2")


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("turn", SLIDES),
        ("turn.arm", SLIDES),
        ("screw", SLIDES),
        ("screw.arm", TURNS),
        ("linear.arm", TURNS),
        ("felt", SLIDES),
        ("felt.arm", SLIDES),
        ("pushed", TURNS),
        ("pushed.arm", TURNS),
    ],
)
@pytest.mark.parametrize("key", ["outputs", "references"])
def test_a_motion_of_the_other_kind_is_refused(tmp_path, key, name, units):
    for unit in units:
        assert _refused(tmp_path, key, name, unit) == [(key, unit)], unit


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("turn", TURNS),
        ("turn.arm", TURNS),
        ("screw", TURNS),
        ("screw.arm", SLIDES),
        ("linear", (*TURNS, *SLIDES)),
        ("felt", TURNS),
        ("pushed.arm", SLIDES),
    ],
)
def test_a_motion_of_its_kind_is_taken(tmp_path, name, units):
    for unit in units:
        assert _refused(tmp_path, "outputs", name, unit) == [], unit


@pytest.mark.parametrize(
    ("name", "unit", "wrong"),
    [
        ("turn", "N", True),
        ("turn.arm", "kN", True),
        ("screw", "N", True),
        ("screw.arm", "N m", True),
        ("screw.arm", "N", False),
        ("linear", "N", False),
        ("linear", "N m", False),
        ("felt", "N", True),
        ("felt", "mN m", False),
        ("pushed", "N m", True),
        ("pushed.arm", "kN", False),
        ("turn", "mN m", False),
    ],
)
def test_a_torque_is_of_what_turns_and_a_force_of_what_slides(tmp_path, name, unit, wrong):
    assert bool(_refused(tmp_path, "inputs", name, unit)) is wrong


def test_a_current_needs_a_motor(tmp_path):
    assert _refused(tmp_path, "inputs", "felt", "A", ", torque_constant_nm_a: 1")
    assert not _refused(tmp_path, "inputs", "turn", "A", ", torque_constant_nm_a: 1")


def test_counts_are_of_a_turn_or_of_a_length(tmp_path):
    assert _refused(tmp_path, "outputs", "turn", "counts", ", resolution_m: 1.0e-6")
    assert not _refused(tmp_path, "outputs", "turn", "counts", ", counts_per_turn: 4096")


def test_what_is_measured_at_the_tool_may_be_a_force(tmp_path):
    assert not _refused(tmp_path, "outputs", "turn", "N", ", side: tool")


@pytest.mark.parametrize("name", ["felt", "felt.arm", "turn.arm"])
@pytest.mark.parametrize("key", ["inputs", "outputs", "references"])
def test_a_side_that_a_joint_does_not_have_is_refused(tmp_path, key, name):
    unit = USUAL[name.partition(".")[0]][key != "inputs"]
    with pytest.raises(SettingsError, match=rf"{key}\[\d\]\.side: "):
        _load(tmp_path, key, name, unit, ", side: motor")


@pytest.mark.parametrize(("name", "refused"), [("drive.arm", True), ("drive", False)])
def test_an_elastic_fit_reads_torques_of_motors(tmp_path, name, refused):
    (tmp_path / "e.yaml").write_text(
        f"""schema_version: 1
name: e
robot: {CONFIGS / "robots" / "motor_bench.yaml"}
campaigns:
  log:
    configurations: {{list_deg: [[0]]}}
    excitation: {{period_s: 1, low_hz: 5, high_hz: 200, lines: all, grid: full}}
    source: {{acquire: {{file: log.csv, sampling_period_s: 0.001, inputs: [{{name: {name}, variable: u}}],
      outputs: [{{name: drive, variable: q}}]}}}}
    estimate: {{compensation: none}}
fits: {{k: {{family: elastic, from: log}}}}
"""
    )
    if not refused:
        load_experiment(tmp_path / "e.yaml")
        return
    with pytest.raises(SettingsError, match=r"fits\.k\.from: .*`drive\.arm`"):
        load_experiment(tmp_path / "e.yaml")

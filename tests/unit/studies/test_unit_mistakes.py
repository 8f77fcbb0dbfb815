"""Logs in wrong units: what is written and read, what counts as named, and how rough a robot file becomes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable
from robid.models.known import load_experiment
from robid.results.finding import CAUSES
from robid.results.scale import Scale, read_scale
from robid.settings.load import load_robot
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.studies.mistakes.report import ASKED, UnitRow, summarise_units, unit_bars
from robid.studies.mistakes.unit_logs import (
    Said,
    Sizes,
    group_of,
    is_named,
    log_of,
    mapping_of,
    mistaken_log,
    rough_robot,
    rough_torque_constants,
    said_of,
    stamps,
    write_log,
)
from robid.studies.mistakes.wrong_units import reading_campaign
from robid.studies.settings.defects import Rough, UnitMistake
from robid.studies.settings.study import load_with_study
from tolerances import IDENTITY

ROOT = Path(__file__).parents[3]
JOINTS = ("turn", "lift")
SIZES = Sizes(np.array([80.0, 100.0]), 65536 / (2 * np.pi), 0.05)
PHASE = 2 * np.pi * np.arange(100) / 50


@pytest.fixture
def log():
    """Two motors, whose torques and angles are sines of lines 3 and 5 with two periods of 50 samples."""
    signal = np.stack([np.sin(3 * PHASE), np.cos(5 * PHASE)], axis=-1).reshape(1, 1, 1, 2, 50, 2)
    record = Record(
        sampling_period_s=1e-3,
        configurations=np.zeros((1, 2)),
        inputs=signal,
        outputs=0.1 * signal,
        input_channels=motor_channels(JOINTS, "torque"),
        output_channels=motor_channels(JOINTS, "angle"),
        output_offset=np.array([[10.0, 20.0]]),
        excited_lines=np.array([3, 5]),
    )
    return log_of(record, JOINTS, 0)


def read(path, log, signals, unit=""):
    """What a mapping makes of a written log, by variable; `unit` in the place of those that it fits."""
    write_log(path, log)
    options = mapping_of(path, JOINTS, signals, 1e-3, {"time": stamps()}).in_place(0, 0, 0)
    channels = [*options.inputs, *options.outputs]
    if unit:
        channels = [new if new.si_unit == one.si_unit else one for one in channels for new in [replace(one, unit=unit)]]
    found = load_variables(path, "mat", [*(one.variable for one in channels), options.time.variable])
    values = {one.variable.partition(".")[2]: one.factor * column(found, one.variable) for one in channels}
    return {**values, "time": column(found, options.time.variable)}


def column(found, name):
    return np.ravel(find_variable(found, name))


def test_a_sound_log_holds_the_record(log, tmp_path):
    found = read(tmp_path / "log.mat", log, ("angle", "speed"))
    assert found["angle_2"] == pytest.approx(20 + 0.1 * np.cos(5 * PHASE), rel=IDENTITY)
    assert found["torque_1"] == pytest.approx(np.sin(3 * PHASE), abs=IDENTITY)
    assert np.diff(found["time"]) == pytest.approx(1e-3, rel=1e-9)
    speed = 0.1 * 2 * np.pi * 3 / 0.05 * np.cos(3 * PHASE)  # three turns in a period of 50 ms
    assert found["speed_1"] == pytest.approx(speed, abs=1e-9)


@pytest.mark.parametrize(
    ("scale", "unit", "variable"),
    [
        ("motor_angle x 180/pi", "deg", "angle_1"),
        ("motor_angle / 2pi", "turn", "angle_2"),
        ("motor_angle x 1000", "mrad", "angle_1"),
        ("torque x 1000", "mN m", "torque_2"),
        ("torque / 1000", "kN m", "torque_1"),
        ("speed x 60/2pi", "rpm", "speed_1"),
    ],
)
def test_a_mistaken_log_is_a_sound_one_in_another_unit(log, tmp_path, scale, unit, variable):
    wrong, signals = read_scale(scale), ("angle", "speed")
    sound = read(tmp_path / "sound.mat", log, signals)
    written = mistaken_log(log, wrong, SIZES.factors(wrong))
    assert np.max(np.abs(read(tmp_path / "wrong.mat", written, signals)[variable] - sound[variable])) > 0.1
    right = read(tmp_path / "wrong.mat", written, signals, unit)
    assert all(right[name] == pytest.approx(sound[name], rel=IDENTITY, abs=IDENTITY) for name in sound)


def test_counts_are_whole_and_the_clock_is_that_of_all(log):
    counts, time = read_scale("motor_angle x counts"), read_scale("time x 1000")
    angle = mistaken_log(log, counts, SIZES.factors(counts))["c1_r1_e1"]["angle_1"]
    assert np.array_equal(angle, np.rint(log["c1_r1_e1"]["angle_1"] * 65536 / (2 * np.pi)))
    stamped = mistaken_log(log, time, SIZES.factors(time))["c1_r1_e1"]
    assert np.diff(stamped["time"]) == pytest.approx(1.0, rel=1e-9)
    assert np.array_equal(stamped["torque_1"], log["c1_r1_e1"]["torque_1"])


def test_a_robot_s_own_factors_are_those_of_its_joints():
    assert SIZES.factors(read_scale("torque x gear_ratio")).tolist() == [80, 100]
    assert SIZES.factors(read_scale("torque / torque_constant")).tolist() == [20, 20]


def test_what_is_said_comes_back_from_its_texts():
    said = Said(("units", "model"), (Scale("torque", "1000", joints=("lift",)), Scale("time", "60", inverse=True)), "")
    assert said_of(**said.texts()) == said
    assert said.first == "units: torque x 1000 of lift"


MILLI = UnitMistake(scale="torque x 1000", same={"arm": ("motor_angle / 1000",)}, refusals=("D123",))


def named(*causes, scales=(), refusal="", robot="arm", wrong=JOINTS):
    return is_named(Said(causes, tuple(scales), refusal), MILLI, robot, JOINTS, wrong)


def test_a_group_is_named_by_the_likeliest_scale_of_the_first_cause():
    right, alike, other = read_scale("torque x 1000"), read_scale("motor_angle / 1000"), read_scale("torque / 1000")
    assert named("units", "model", scales=[right])
    assert named("units", scales=[alike])
    assert not named("units", scales=[alike], robot="drive")
    assert not named("units", scales=[other, right])
    assert not named("units")
    assert not named("model", "units", scales=[right])


def test_the_right_joint_must_be_named():
    right, lift = read_scale("torque x 1000"), Scale("torque", "1000", joints=("lift",))
    assert named("units", scales=[lift])
    assert named("units", scales=[lift], wrong=["lift"])
    assert not named("units", scales=[lift], wrong=["turn"])
    assert not named("units", scales=[right], wrong=["turn"])


def test_a_refusal_must_name_the_unit():
    assert named(refusal="D123 The time unit is off by a factor of 1000: the steps are 1 s.")
    points = f"this points to {CAUSES['units']}; with it, free parameters change nothing"
    assert named(refusal=f"values of the torque are 980 times too large, as if mN m were read as N m: {points}")
    assert not named(refusal=f"values of the motor angle are 57 times too large, as if deg were read as rad: {points}")
    assert not named(refusal="D131 free parameters change nothing: gear.damping")


def test_any_word_on_units_accuses_a_sound_record():
    assert Said(("units",), (), "").accuses_units
    assert Said((), (), "correct the unit of `time`").accuses_units
    assert not Said(("model", "units"), (), "").accuses_units
    assert not Said((), (), "a united front of noise").accuses_units


def reached(rows):
    found, asked = summarise_units(rows), unit_bars(rows)
    asked |= {name: limits for name, limits in ASKED.items() if name in found}
    return [limits.is_reached(found[name]) for name, limits in asked.items()]


def test_figures_are_shares_of_the_cases_and_a_number_of_sound_records():
    rows = [UnitRow("a", "drive", 1, False, True, True, ""), UnitRow("a", "arm", 1, False, False, True, "")]
    rows += [UnitRow("rough", "drive", seed, True, False, seed < 3, "") for seed in range(10)]
    found = summarise_units(rows)
    assert (found["units.named"], found["units.drive.named"], found["units.arm.named"]) == (0.5, 1, 0)
    assert (found["units.false"], found["units.sound"], found["units.a.named"]) == (3, 10, 0.5)
    assert reached(rows) == [False, False, False]
    assert reached([rows[0], *rows[3:]]) == [True, True, True]
    assert summarise_units([]) == {}


ROBOTS = ("configs/robots/geared_drive.yaml", "configs/robots/kr300.yaml", "tests/stages/arm.yaml")


@pytest.mark.parametrize("path", ROBOTS)
def test_a_rough_robot_file_is_off_by_seeded_factors(path):
    sound, rough = load_robot(ROOT / path), Rough()
    one, again, other = (rough_robot(sound, rough, seed) for seed in (1, 1, 2))
    assert one == again
    assert one != other
    robots = [file.to_robot() for file in (sound, one)]
    for before, after in zip(*(robot.joints for robot in robots), strict=True):
        assert 1 / 2.5 < after.motor.inertia_kgm2 / before.motor.inertia_kgm2 < 2.5
        assert 1 / 2 <= after.link.mass_kg / before.link.mass_kg <= 2
        assert after.motor.inertia_kgm2 != before.motor.inertia_kgm2
        assert after.motor.friction.coulomb_nm <= after.motor.friction.static_nm
    for before, after in zip(*(robot.springs for robot in robots), strict=True):
        assert 1 / 3 < after.stiffness / before.stiffness < 3
        assert (after.name, after.joint, after.place) == (before.name, before.joint, before.place)
        if before.outboard is not None:
            parts = before.outboard.mass_kg / robots[0].joints[before.joint].link.mass_kg
            assert after.outboard.mass_kg / robots[1].joints[after.joint].link.mass_kg == pytest.approx(parts)
    assert rough_robot(sound, Rough(**dict.fromkeys(Rough.model_fields, 1.0)), 1) == sound


def test_torque_constants_are_off_joint_by_joint():
    factors = rough_torque_constants(6, Rough(torque_constant=1.5), 7)
    assert len(set(factors)) == 6
    assert np.all((factors > 1 / 1.5) & (factors < 1.5))


def test_every_mistake_of_the_study_has_a_group_for_robots_of_the_study():
    units = load_with_study(ROOT / "configs/studies/mistakes.yaml").experiment.study.units
    assert len(units.mistakes) == 12
    assert len(units.robots) == 3
    for mistake in units.mistakes.values():
        assert {*mistake.same, *mistake.log} <= set(units.robots)
        for robot in units.robots:
            group = group_of(mistake, robot)
            assert len(set(group)) == len(group)


@pytest.mark.parametrize("name", ["units_drive", "units_elastic", "units_rigid"])
def test_a_clock_in_another_unit_stretches_all_that_is_stated_of_time(name, tmp_path):
    loaded = load_experiment(ROOT / "configs" / f"{name}.yaml")
    campaign = loaded.experiment.campaigns["estimation"]
    acquire = mapping_of(tmp_path / "log.mat", [joint.name for joint in loaded.robot.joints], ("angle",), 1.0, {})
    read = reading_campaign(campaign, acquire, 1000.0)
    assert read.source.acquire is acquire
    assert read.realizations == campaign.realizations
    if not campaign.is_trajectory:
        before, after = campaign.excitation, read.excitation
        assert after.period_s == 1000 * before.period_s
        assert (after.low_hz, after.high_hz) == (before.low_hz / 1000, before.high_hz / 1000)
        assert (after.count, after.rms, after.seed) == (before.count, before.rms, before.seed)
        assert reading_campaign(campaign, acquire, 1.0).excitation == before

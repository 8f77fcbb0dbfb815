"""Logs of rigid fits, good and bad, through the command line: one message, its exit code, and its remedy once."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from rigid_logs import PERIOD_S, fourier_motion, shot_along, write_log
from robid.models.known import load_experiment

CONFIGS = Path(__file__).parents[2] / "configs"
EXPERIMENT = """schema_version: 1
name: small
robot: arm.yaml
campaigns:
  motion: {source: {acquire: &log {file: motion.csv, format: csv, sampling_period_s: 2.0e-3, one_shot: true,
    time: {variable: t},
    inputs: [{name: turn, variable: u1, hold: band_limited}, {name: lift, variable: u2, hold: band_limited}],
    outputs: [{name: turn, variable: q1}, {name: lift, variable: q2}]}}}
  other: {source: {acquire: {<<: *log, file: other.csv}}}
fits:
  arm: {family: rigid, from: motion, validate_on: other, filters: {position_cut_hz: 10}}
execution: {backend: serial}
"""


@pytest.fixture
def logs(shop):
    """A folder with the logs of two motions and the experiment that reads them."""
    (shop.folder / "small.yaml").write_text(EXPERIMENT)
    shop.robot = load_experiment(shop.folder / "small.yaml").robot.to_robot()
    shop.shots = {}
    for seed, name in enumerate(("motion", "other")):
        shop.shots[name] = shot_along(shop.robot, fourier_motion(shop.robot, 5000, seed), seed=seed)
        write_log(shop.folder / f"{name}.csv", shop.shots[name])
    return shop


def _rewrite(logs, name="motion", time_s=None, **factors):
    shot = logs.shots[name]
    changed = {key: np.asarray(factor) * getattr(shot, key) for key, factor in factors.items()}
    write_log(logs.folder / f"{name}.csv", type(shot)(**{**shot.__dict__, **changed}), time_s)


def test_a_sound_log_is_to_be_trusted(logs):
    answer = logs.robid("run", "small.yaml", "--strict")
    assert answer.code == 0, answer.err
    assert "warning" not in answer.err


def test_a_validation_on_the_same_motion_says_that_it_cannot_generalise(logs):
    again = shot_along(logs.robot, fourier_motion(logs.robot, 5000, 0), seed=7)
    write_log(logs.folder / "other.csv", again)
    answer = logs.robid("run", "small.yaml", "--strict")
    assert answer.code == 5, answer.err
    assert "the validation repeats the motion of the fit: it says nothing of other motions" in answer.flat
    write_log(logs.folder / "other.csv", logs.shots["other"])
    assert logs.robid("run", "small.yaml", "--strict").code == 0


def test_a_copy_of_the_log_of_the_fit_validates_nothing(logs):
    shutil.copy(logs.folder / "motion.csv", logs.folder / "other.csv")
    answer = logs.robid("run", "small.yaml")
    assert answer.code == 4, answer.err
    assert "contains samples of the fit: 1250 from sample 1 on are those of `motion`" in answer.flat
    assert "remedy: validate on another recording" in answer.flat


@pytest.mark.parametrize(
    ("factors", "told", "old", "new"),
    [
        ({"position": 180 / np.pi}, "state `unit: deg` for the motor angle", "variable: q1", "variable: q1, unit: deg"),
        ({"torque": 1e3}, "state `unit: mN m` for the torque", "variable: u1", "variable: u1, unit: mN m"),
    ],
)
def test_units_that_are_off_are_not_to_be_used_until_they_are_stated(logs, factors, told, old, new):
    for name in ("motion", "other"):
        _rewrite(logs, name, **factors)
    answer = logs.robid("run", "small.yaml")
    assert answer.code == 5, answer.err
    assert told in answer.flat, answer.flat
    assert "Look first for units or gear ratios of the log that are off" in answer.flat
    assert "Traceback" not in answer.err
    for index in ("1", "2"):
        logs.change(old.replace("1", index), new.replace("1", index))
    assert logs.robid("run", "small.yaml").code == 0


def test_gaps_and_jitter_are_refused(logs):
    even = PERIOD_S * np.arange(5000)
    _rewrite(logs, time_s=even + 0.05 * (even > 4))
    logs.refuse(4, "1 gap, about 25 missing samples")
    moments = even + 3e-4 * np.sin(1e4 * even)
    shot = logs.shots["motion"]
    taken = CubicSpline(even, shot.position)(moments)  # when the stamps say
    write_log(logs.folder / "motion.csv", type(shot)(**{**shot.__dict__, "position": taken}), moments)
    logs.refuse(4, "deviate from 0.002 s by up to")
    write_log(logs.folder / "motion.csv", logs.shots["motion"])
    assert logs.robid("run", "small.yaml").code == 0


def test_stamps_that_jitter_move_no_samples_that_were_taken_evenly(logs):
    def estimate():
        assert logs.robid("run", "small.yaml").code == 0
        with h5py.File(logs.runs / "fits" / "arm" / "model.h5") as file:
            return file["estimate/value"][:]

    found, even = estimate(), PERIOD_S * np.arange(5000)
    _rewrite(logs, time_s=even + 3e-4 * np.sin(1e4 * even))
    np.testing.assert_allclose(estimate(), found, rtol=1e-5, atol=1e-8)


def test_a_motion_that_excites_too_little_names_what_suffers(logs):
    write_log(logs.folder / "motion.csv", shot_along(logs.robot, fourier_motion(logs.robot, 5000, share=0.005)))
    answer = logs.robid("run", "small.yaml", "--strict")
    assert answer.code == 5, answer.err
    assert "Traceback" not in answer.err
    assert "F013" in answer.flat
    write_log(logs.folder / "motion.csv", logs.shots["motion"])
    assert logs.robid("run", "small.yaml", "--strict").code == 0


def test_a_cut_off_above_half_the_sampling_rate_is_a_mistake_of_the_settings(logs):
    logs.change("position_cut_hz: 10", "position_cut_hz: 250")
    told = (
        "fits.arm.filters.position_cut_hz: S088 250 Hz is not below half the sampling rate of `motion` (from), 250 Hz"
    )
    logs.refuse(2, told, "`other` (validate_on)")
    logs.change("filters: {position_cut_hz: 250}", "filters: {}")
    assert logs.robid("run", "small.yaml").code == 0


def test_a_current_needs_its_torque_constant(logs):
    logs.change("variable: u1,", "variable: u1, unit: A,")
    logs.refuse(2, "S370")
    logs.change("unit: A,", "unit: A, torque_constant_nm_a: 1,")
    assert logs.robid("run", "small.yaml").code == 0


def test_a_motor_that_never_moves_and_a_short_record_are_refused(logs):
    write_log(
        logs.folder / "motion.csv",
        type(logs.shots["motion"])(
            **{**logs.shots["motion"].__dict__, "position": logs.shots["motion"].position * [1, 0]}
        ),
    )
    _fails(logs, "lift never moves", "move all joints at the same time")
    short = {key: getattr(logs.shots["motion"], key)[:600] for key in ("position", "torque")}
    write_log(logs.folder / "motion.csv", type(logs.shots["motion"])(**{**logs.shots["motion"].__dict__, **short}))
    _fails(logs, "D184 the filters leave 0 rows of 600 samples", "state a higher `filters.position_cut_hz`")
    logs.change("position_cut_hz: 10", "position_cut_hz: 40")
    assert "Traceback" not in logs.robid("run", "small.yaml").err
    assert (logs.runs / "fits" / "arm" / "model.h5").exists()


def _fails(logs, *texts):
    answer = logs.robid("run", "small.yaml")
    assert answer.code == 4, answer.err
    assert "Traceback" not in answer.err
    for text in ("remedy: ", *texts):
        assert text in answer.flat


def test_an_angle_in_the_wrong_unit_is_named_and_its_remedy_ends_in_a_good_fit(shop, data_folder, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("tx40").parent.resolve()))
    stated, file = "{name: joint_5, variable: Joint_5", shop.folder / "tx40.yaml"
    text = (CONFIGS / "tx40.yaml").read_text().replace("robots/", f"{CONFIGS}/robots/")
    wrong = f"{stated}, unit: deg}}".join(text.rsplit(f"{stated}}}", 1))  # of the outputs, which come last
    assert wrong != text
    file.write_text(wrong)
    answer = shop.robid("run", "tx40.yaml", "--strict")
    assert answer.code != 0
    assert "state `unit: rad` for the motor angle of joint_5" in answer.flat
    assert "too poor" not in answer.flat
    file.write_text(wrong.replace("unit: deg", "unit: rad"))
    assert "do not use" not in shop.robid("run", "tx40.yaml").flat.lower()

"""Logs of signals of which nothing but a band is known, through the CLI: what comes out, what is refused and why."""

import re

import numpy as np
import pytest
from scipy.io import savemat

from arbitrary_logs import SIGNALS, play, truth, write_logs
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.models.known import load_experiment
from robid.simulate.options import Imperfections

CONFIGURATION_DEG = (20.0, 30.0)
FILE = """schema_version: 1
name: noise
robot: arm.yaml
campaigns:
  log:
    configurations: {list_deg: [[20, 30]]}
    excitation: {signal: arbitrary, low_hz: 3, high_hz: 60, resolution_hz: 0.5}
    experiments: 2
    source:
      acquire:
        file: "logs/log{experiment}.mat"
        format: mat
        sampling_period_s: 1.0e-3
        inputs: [{name: turn, variable: "torque(:,1)"}, {name: lift, variable: "torque(:,2)"}]
        outputs: [{name: turn, variable: "angle(:,1)"}, {name: lift, variable: "angle(:,2)"}]
        # references
    estimate: {compensation: none}
execution: {backend: serial}
"""
REFERENCES = (
    'references: [{name: turn, variable: "reference(:,1)", unit: rad/s},'
    ' {name: lift, variable: "reference(:,2)", unit: rad/s}]'
)


@pytest.fixture(scope="module")
def arm(tmp_path_factory, workshop):
    with pytest.MonkeyPatch.context() as monkeypatch:
        shop = workshop(tmp_path_factory.mktemp("arm"), monkeypatch)
        return load_experiment(shop.folder / "small.yaml").robot.to_robot()


@pytest.fixture(scope="module")
def played(arm):
    """Records of 12 s of each signal, linear robot with noise of its sensors."""
    flaws = Imperfections(encoder_noise_rad=1e-5, torque_noise_nm=0.02)
    where = np.deg2rad(CONFIGURATION_DEG)

    def record(name):
        reference = np.stack([SIGNALS[name](12_000, 2, seed) for seed in (11, 12)])
        return play(arm, reference, where, flaws)

    return {name: record(name) for name in SIGNALS}


@pytest.fixture
def logs(shop, played):
    """A folder with two logs of noise and the experiment that reads them."""
    write_logs(played["noise"], shop.folder / "logs")
    (shop.folder / "noise.yaml").write_text(FILE)
    shop.experiment, shop.runs = "noise.yaml", shop.folder / "runs" / "noise"
    return shop


def found(shop, campaign="log"):
    return frf_from_artifact(read_artifact(shop.runs / campaign / "frf.h5", FRF))


def run(shop):
    answers = [
        shop.robid(stage, "noise.yaml", "--force")
        for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf")
    ]
    assert all(answer.code == 0 for answer in answers), answers
    return " ".join(answer.out + answer.err for answer in answers)


@pytest.mark.parametrize(("name", "reference"), [("noise", False), ("sweep", True), ("moves", False)])
def test_a_signal_nobody_designed_gives_the_response_of_the_linear_robot(logs, played, arm, name, reference):
    write_logs(played[name], logs.folder / "logs")
    if reference:
        logs.change("# references", REFERENCES, "noise.yaml")
    answer = run(logs)
    assert "2 arbitrary signals of 12 s, 6 segments of 2 s" in answer
    frf = found(logs)
    assert len(frf.lines) == 115
    error = np.abs(frf.response[0] - truth(arm, np.deg2rad(CONFIGURATION_DEG), frf.frequency_hz))
    radius = frf.error_radius(0.95)[0]
    assert np.mean(error <= radius) >= 0.90
    own = np.arange(2)
    assert np.median((radius / np.abs(frf.response[0]))[:, own, own]) < 0.05  # and it says something
    record = record_from_artifact(read_artifact(logs.runs / "log" / "record.h5", RECORD))
    assert record.is_arbitrary
    assert record.is_one_shot
    assert (record.reference is not None) == reference


def test_several_configurations_have_one_grid_whatever_their_logs_last(logs, played):
    logs.change("[[20, 30]]", "[[20, 30], [0, 0]]", "noise.yaml")
    logs.change("log{experiment}", "log{configuration}{experiment}", "noise.yaml")
    for configuration, length in ((1, 12_000), (2, 9_000)):
        for experiment in (1, 2):
            part = (0, 0, experiment - 1, 0, slice(length))
            columns = {"torque": played["noise"].inputs[part], "angle": played["noise"].outputs[part]}
            savemat(logs.folder / "logs" / f"log{configuration}{experiment}.mat", columns)
    answer = run(logs)
    assert "4 arbitrary signals of 8 s, 4 segments of 2 s" in answer
    frf = found(logs)
    assert frf.response.shape == (2, 115, 2, 2)
    np.testing.assert_allclose(frf.response[0], frf.response[1], rtol=1e-5)


CUT = re.compile(r"Set from_s to ([\d.]+) and to_s to ([\d.]+): the longest part")


@pytest.mark.parametrize("resample", [False, True])
@pytest.mark.parametrize("missing", ["dropped", "nan", "both"])
def test_logs_with_missing_samples_are_cut_to_what_is_whole_in_all_of_them(logs, played, missing, resample):
    """Each log tells its own longest part within what is left of the one before."""
    for experiment, (gap, hole) in ((1, (2100, 9000)), (2, (8200, 1500))):
        torque, angle = (x[0, 0, experiment - 1, 0].copy() for x in (played["noise"].inputs, played["noise"].outputs))
        if missing != "dropped":
            torque[hole : hole + 40, 1] = np.nan  # more than interpolation fills
        kept = np.delete(np.arange(12_000), np.s_[gap : gap + 3] if missing != "nan" else [])
        columns = {"t": (5 + kept * 1e-3)[:, None], "torque": torque[kept], "angle": angle[kept]}
        savemat(logs.folder / "logs" / f"log{experiment}.mat", columns)
    logs.change("# references", "time: {variable: t}" + "\n        resample: time" * resample, "noise.yaml")
    rounds = 0
    while (answer := logs.robid("run", "noise.yaml")).code:
        rounds += 1
        assert (answer.code, rounds) in {(4, 1), (4, 2)}
        (found_part,) = set(CUT.findall(answer.flat))
        text = (logs.folder / "noise.yaml").read_text()
        text = re.sub(r"        (from|to)_s: .*\n", "", text)
        cut = "        from_s: {}\n        to_s: {}\n".format(*found_part)
        (logs.folder / "noise.yaml").write_text(text.replace("        format: mat\n", f"        format: mat\n{cut}"))
    assert rounds
    record = record_from_artifact(read_artifact(logs.runs / "log" / "record.h5", RECORD))
    first, last = {"dropped": (2103, 8199), "nan": (1540, 8999), "both": (2103, 8199)}[missing]
    assert any("used from" in note for note in record.notes)
    used = record.inputs.shape[4]
    assert used == (last + 1 - first) // 2000 * 2000
    expected = played["noise"].inputs[0, 0, 0, 0, first : first + used]
    np.testing.assert_allclose(record.inputs[0, 0, 0, 0], expected, atol=2e-6 * np.abs(expected).max())


def test_a_part_that_is_none_is_refused(logs):
    logs.change("# references", "from_s: 30", "noise.yaml")
    answer = logs.robid("run", "noise.yaml")
    assert answer.code == 4
    assert "It lasts 11.999 s" in answer.flat
    logs.change("from_s: 30", "from_s: 3\n        to_s: 2", "noise.yaml")
    assert "2 is not above from_s 3" in logs.robid("run", "noise.yaml").flat
    logs.change("to_s: 2", "to_s: 9", "noise.yaml")
    run(logs)


REFUSED = [
    # what is changed, exit code, what is said, and what then helps
    ("resolution_hz: 0.5", "resolution_hz: 0.05", 4, "resolution_hz to 0.08334 or more", ("0.05", "0.08334")),
    ("resolution_hz: 0.5", "resolution_hz: 30", 2, "lower resolution_hz to 14.2", ("z: 30", "z: 14.2")),
    ("high_hz: 60", "high_hz: 500", 2, "lower high_hz", ("500", "60")),
    ("        # ref", "        drop_periods: 1\n        # ref", 2, "has no periods", ("drop_periods: 1", "")),
    ("        # ref", "        one_shot: true\n        # ref", 2, "leave one of them out", ("one_shot: true", "")),
    ("    experiments: 2", "    periods: 3\n    experiments: 2", 2, "leave it out", ("    periods: 3\n", "")),
    (
        "        # ref",
        "        resample: period\n        # ref",
        2,
        "S216",
        ("resample: period", ""),
    ),
    ("compensation: none", "estimator: joint", 2, "S226", ("estimator: joint", "")),
    ("on: none", "on: silent_lines", 2, "use `compensation: nominal` or `none`", ("silent_lines", "none")),
]


@pytest.mark.parametrize(("old", "new", "code", "said", "help_"), REFUSED)
def test_what_cannot_be_is_refused_and_the_remedy_works(logs, old, new, code, said, help_):
    logs.change(old, new, "noise.yaml")
    answer = logs.robid("run", "noise.yaml")
    assert answer.code == code, answer.err
    assert said in answer.flat
    logs.change(*help_, "noise.yaml")
    run(logs)


def test_a_signal_that_cannot_be_played_is_not_simulated(shop):
    shop.change("excitation: *excitation", "excitation: {signal: arbitrary, low_hz: 2, high_hz: 9, resolution_hz: 1}")
    shop.refuse(2, "S174")


def test_lines_are_found_in_logs_only(shop):
    shop.change("count: 14", "lines: found")
    shop.refuse(2, "S175")


FOUND = """schema_version: 1
name: noise
robot: arm.yaml
campaigns:
  log:
    configurations: {list_deg: [[20, 30], [0, 0]]}
    excitation: {period_s: 1, low_hz: 2, high_hz: 60, grid: full, lines: found}
    periods: 4
    source:
      acquire:
        file: "logs/{configuration}{experiment}.mat"
        format: mat
        sampling_period_s: 1.0e-3
        inputs: [{name: turn, variable: "u(:,1)"}, {name: lift, variable: "u(:,2)"}]
        outputs: [{name: turn, variable: "q(:,1)"}, {name: lift, variable: "q(:,2)"}]
    estimate: {compensation: none}
execution: {backend: serial}
"""


def test_lines_are_found_over_all_configurations_and_weak_ones_left_out_where_they_are(shop):
    """The second configuration lacks three lines of the first: they are left out of it alone, told and listed."""
    lines, lost = np.arange(5, 50, 2), [15, 17, 33]
    generator, time = np.random.default_rng(3), np.arange(4000) * 1e-3
    (shop.folder / "logs").mkdir()
    (shop.folder / "noise.yaml").write_text(FOUND)
    shop.experiment, shop.runs = "noise.yaml", shop.folder / "runs" / "noise"
    for configuration in (1, 2):
        played = np.setdiff1d(lines, lost if configuration == 2 else [])
        wave = [np.cos(2 * np.pi * np.outer(time, played) + generator.uniform(0, 6, played.size)) for _ in range(2)]
        for experiment, sign in ((1, 1.0), (2, -1.0)):
            torque = np.stack([wave[0].sum(axis=1), sign * wave[1].sum(axis=1)], axis=1)
            size = -1 / (2 * np.pi * played) ** 2
            angle = np.stack([wave[0] @ size, sign * wave[1] @ size], axis=1)
            noise = generator.standard_normal((2, *torque.shape))
            columns = {"u": torque + 1e-2 * noise[0], "q": angle + 1e-6 * noise[1]}
            savemat(shop.folder / "logs" / f"{configuration}{experiment}.mat", columns)
    told = run(shop)
    assert "Lines found to be excited: 5-49 by 2, 23 of 59 of the band." in told
    assert "too little is known of turn at 3 of 23 lines (15, 17, 33 Hz)" in " ".join(told.split())
    frf = found(shop)
    np.testing.assert_array_equal(frf.lines, lines)
    assert not frf.dropped[0].any()
    np.testing.assert_array_equal(np.flatnonzero(frf.dropped[1].all(axis=1)), np.searchsorted(lines, lost))
    np.testing.assert_allclose(frf.response[0], np.broadcast_to(np.eye(2), (23, 2, 2)), atol=0.05)


def test_a_log_is_read_anew_where_its_signal_is_another_one_on_the_same_lines(shop):
    """Lines that are found, all lines and those of an arbitrary signal may have one grid, and so one excitation."""
    one = FOUND.replace("[[20, 30], [0, 0]]", "[[20, 30]]").replace("{configuration}{experiment}", "{experiment}")
    (shop.folder / "noise.yaml").write_text(one.replace("none}", "none, weak_line_std: 1.0e+9}"))
    (shop.folder / "logs").mkdir()
    shop.experiment, shop.runs = "noise.yaml", shop.folder / "runs" / "noise"
    generator = np.random.default_rng(3)
    for experiment in (1, 2):
        torque = np.tile(generator.standard_normal((1000, 2)), (4, 1))
        columns = {name: torque + 1e-2 * generator.standard_normal(torque.shape) for name in "uq"}
        savemat(shop.folder / "logs" / f"{experiment}.mat", columns)
    record = shop.runs / "log" / "record.h5"

    def notes(signal):
        shop.change(signal[0], signal[1], "noise.yaml")
        assert shop.robid("run", "noise.yaml").code == 0
        found = record_from_artifact(read_artifact(record, RECORD))
        return found.segments, any("found to be excited" in note for note in found.notes)

    periodic = "{period_s: 1, low_hz: 2, high_hz: 60, grid: full, lines: found}\n    periods: 4"
    every, arbitrary = periodic.replace("found", "all"), "{signal: arbitrary, low_hz: 2, high_hz: 60, resolution_hz: 1}"
    assert notes((periodic, periodic)) == (0, True)
    assert notes((periodic, every)) == (0, False)
    assert notes((every, arbitrary)) == (4, False)
    assert notes((arbitrary, periodic)) == (0, True)

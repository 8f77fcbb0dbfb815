"""Channels that are weighted sums of variables, and numbers that begin again after a range."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from log_files import WRITERS
from robid.errors import DataError
from robid.logs.importing import import_shot
from robid.logs.mapping import LogMapping
from robid.logs.streams import NoSumError, UnknownNameError, parse_sum
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

KNOWN = ["q2", "q3", "a", "b", "t 1", "torque [Nm]", "motor-angle", "a-b", "1", "2", "3", "X", "/s.effort[elbow]"]
COUNT = 400
RNG = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("text", "weights"),
    [
        ("q2 + q3", {"q2": 1, "q3": 1}),
        ("q3-q2", {"q3": 1, "q2": -1}),
        ("-q2", {"q2": -1}),
        ("0.5*a - 2*b", {"a": 0.5, "b": -2}),
        ("(a + b)/2", {"a": 0.5, "b": 0.5}),
        ("q3 - 130/150*q2", {"q3": 1, "q2": -130 / 150}),
        ("q2 - (q3 - 2*a)", {"q2": 1, "q3": -1, "a": 2}),
        ("a-b - b", {"a-b": 1, "b": -1}),
        ("torque [Nm] + motor-angle", {"torque [Nm]": 1, "motor-angle": 1}),
        ("`t 1` + 1e-3*a", {"t 1": 1, "a": 1e-3}),
        ("1 + 0.5*2", {"1": 1, "2": 0.5}),
        ("X(:,2) - X(:, 3)", {"X(:,2)": 1, "X(:, 3)": -1}),
        ("a - s.effort[elbow]", {"a": 1, "s.effort[elbow]": -1}),
    ],
)
def test_a_sum_is_read_as_it_is_written(text, weights):
    assert parse_sum(text, KNOWN).weights == pytest.approx(weights)


@pytest.mark.parametrize("text", ["q2*q3", "q2/q3", "q2 + 90", "q2 +", "(q2 + q3", "a - a", "q2 / 0", "+", "(" * 50])
def test_what_is_no_weighted_sum_is_refused(text):
    with pytest.raises(NoSumError):
        parse_sum(text, KNOWN)


def test_a_variable_that_there_is_not_is_named():
    with pytest.raises(UnknownNameError) as caught:
        parse_sum("q2 + q9", KNOWN)
    assert caught.value.name == "q9"


def shot_of(file, variable="q", **changes):
    return LogMapping(
        file=file,
        sampling_period_s=1e-3,
        one_shot=True,
        inputs=(InputChannel("A1", "tau"),),
        outputs=(OutputChannel("A1", variable, **changes),),
    )


def motion_of(record):
    return (record.outputs + record.output_offset).ravel()


@pytest.mark.parametrize("kind", list(WRITERS))
def test_a_sum_is_read_from_every_format(tmp_path, kind):
    write, name = WRITERS[kind]
    columns = {name: RNG.normal(size=COUNT) for name in ("tau", "q", "r")}
    file, names = write(tmp_path / name, columns)
    mapping = shot_of(file, f"0.5*{names['q']} - {names['r']}", unit="deg", sign=-1, scale=2.0)
    mapping = replace(mapping, inputs=(InputChannel("A1", f"{names['tau']} + {names['r']}"),))
    record = import_shot(mapping)
    np.testing.assert_allclose(record.inputs.ravel(), columns["tau"] + columns["r"], atol=1e-6)
    wanted = -2.0 * np.deg2rad(0.5 * columns["q"] - columns["r"])
    np.testing.assert_allclose(motion_of(record), wanted, atol=1e-6)


def test_a_missing_variable_of_a_sum_is_told_with_those_that_there_are(tmp_path):
    file, _ = WRITERS["csv"][0](tmp_path / "log.csv", {"tau": np.arange(50.0), "q2": np.arange(50.0)})
    with pytest.raises(DataError, match="no variable `q3`") as caught:
        import_shot(shot_of(file, "q2 + q3"))
    assert "`q2`" in caught.value.remedy
    with pytest.raises(DataError, match="D040"):
        import_shot(shot_of(file, "way-of-it"))


def test_variables_of_a_sum_are_brought_to_one_clock(tmp_path):
    first, other = 1e-3 * np.arange(3000), 1e-3 * np.arange(3000) + 0.4e-3
    told = {"t": first, "tau": np.cos(9 * first), "q2": np.sin(7 * first), "t3": other, "q3": np.sin(5 * other)}
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in told.items()})
    mapping = replace(shot_of(tmp_path / "log.mat", "q3 + q3", time="t3"), time=TimeChannel("t", "s"))
    at = import_shot(mapping)
    moments = at.sampling_period_s * np.arange(at.outputs.shape[4])
    starts = [begin for begin in first[:60] if abs(motion_of(at)[0] - 2 * np.sin(5 * begin)) < 1e-6]
    assert len(starts) == 1
    np.testing.assert_allclose(motion_of(at), 2 * np.sin(5 * (moments + starts[0])), atol=1e-6)


@pytest.mark.parametrize(
    ("wrap", "unwrap", "changes"),
    [
        (65536, 65536, {"unit": "counts", "counts_per_turn": 10000}),
        (65536, 65536, {"unit": "counts", "resolution_m": 1e-6}),
        (360, True, {"unit": "deg"}),
        (2 * np.pi, True, {"unit": "rad"}),
        (4096, True, {"unit": "counts", "counts_per_turn": 4096}),
        (500.0, 500.0, {"unit": "mm"}),
    ],
)
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_numbers_that_begin_again_go_on(tmp_path, wrap, unwrap, changes, low):
    turned = wrap * (0.2 + 2.6 * np.sin(np.linspace(0, 9, 2000)))
    wrapped = np.mod(turned - low * wrap, wrap) + low * wrap
    file, _ = WRITERS["csv"][0](tmp_path / "log.csv", {"tau": RNG.normal(size=2000), "q": wrapped})
    mapping = shot_of(file, unwrap=unwrap, **changes)
    record = import_shot(mapping)
    factor = mapping.outputs[0].factor
    np.testing.assert_allclose(record.outputs.ravel(), factor * (turned - turned[0]), atol=1e-9 * wrap * abs(factor))
    assert any("jumped by" in note for note in record.notes)


def test_a_joint_that_wraps_is_unwrapped_before_its_gear(tmp_path):
    turned = 700 * np.sin(np.linspace(0, 9, 2000))
    columns = {"tau": RNG.normal(size=2000), "q": np.mod(turned + 180, 360) - 180}
    file, _ = WRITERS["csv"][0](tmp_path / "log.csv", columns)
    with pytest.raises(DataError, match="jumps by a turn") as caught:
        import_shot(shot_of(file, unit="deg", scale=100.5))
    assert "`unwrap: true`" in caught.value.remedy
    record = import_shot(shot_of(file, unit="deg", scale=100.5, unwrap=True))
    wanted = np.deg2rad(100.5 * turned)
    np.testing.assert_allclose(record.outputs.ravel(), wanted - wanted[0], atol=1e-6)


def test_each_variable_of_a_sum_is_unwrapped_by_itself(tmp_path):
    first, other = 400 * np.sin(np.linspace(0, 9, 2000)), 300 * np.cos(np.linspace(0, 8, 2000))
    columns = {"tau": RNG.normal(size=2000), "a": np.mod(first, 360), "b": np.mod(other, 360)}
    file, _ = WRITERS["csv"][0](tmp_path / "log.csv", columns)
    record = import_shot(shot_of(file, "a - 0.25*b", unit="deg", unwrap=True))
    wanted = np.deg2rad(first - 0.25 * other)
    np.testing.assert_allclose(record.outputs.ravel(), wanted - wanted[0], atol=1e-9)


@pytest.mark.parametrize(
    "channel",
    [
        OutputChannel("q", "q", unit="mm", unwrap=True),
        OutputChannel("q", "q", unit="rad/s", unwrap=True),
        OutputChannel("q", "q", unwrap=-1.0),
    ],
)
def test_a_range_that_makes_no_sense_is_a_problem(channel):
    assert "unwrap" in " ".join(channel.problems())

"""Objects `idfrd` and `frd` as MATLAB saves their structures: units, periods, delays and covariances of the manual."""

import numpy as np
import pytest
from scipy.io import savemat

import robid
from robid.errors import DataError
from robid.logs.formats.load import load_responses
from robid.logs.responses.proposing import recognise
from robid.logs.responses.structures import object_table
from robid.logs.responses.table import contradictions_refused
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.response_options import FrequencyColumn, ResponseOptions
from tolerances import IDENTITY

FREQUENCY = np.geomspace(1, 90, 40)
OMEGA = 2 * np.pi * FREQUENCY
RESPONSE = np.array([[1 / (1 + 0.01j * OMEGA), 2 / (1 + 0.02j * OMEGA)], [3j / OMEGA, 1 - 0.1j * OMEGA]])


def saved(path, **fields):
    """A structure `G` of two outputs and two inputs with the fields that MATLAB gives one, some of them others."""
    cells = {side: np.array(names, object)[:, None] for side, names in (("Input", ["u", "v"]), ("Output", ["x", "y"]))}
    whole = {
        "ResponseData": RESPONSE,
        "Frequency": OMEGA[:, None],
        "FrequencyUnit": "rad/TimeUnit",
        "SpectrumData": np.zeros((0, 0)),
        "CovarianceData": np.zeros((0, 0)),
        "NoiseCovariance": np.zeros((0, 0)),
        "InterSample": "zoh",
        "IODelay": np.zeros((2, 2)),
        "InputDelay": np.zeros((2, 1)),
        "OutputDelay": np.zeros((2, 1)),
        "Ts": 0.0,
        "TimeUnit": "seconds",
        "InputName": cells["Input"],
        "InputUnit": np.array(["N m", "N m"], object)[:, None],
        "OutputName": cells["Output"],
        "Name": "",
        "Notes": np.zeros((0, 1)),
        "UserData": np.zeros((0, 0)),
    }
    savemat(path, {"G": {key: value for key, value in (whole | fields).items() if value is not None}})
    return path


def options(**more):
    return ResponseOptions(
        inputs=tuple(InputChannel(name=name, variable=name) for name in "uv"),
        outputs=tuple(OutputChannel(name=name, variable=name) for name in "xy"),
        **more,
    )


def read(path, **more):
    with contradictions_refused(str(path)):
        return object_table(load_responses(path), "G", options(**more))


@pytest.mark.parametrize(
    ("fields", "factor"),
    [
        ({"FrequencyUnit": "rad/s"}, 2 * np.pi),
        ({"FrequencyUnit": "Hz"}, 1.0),
        ({"FrequencyUnit": "kHz"}, 1e-3),
        ({"FrequencyUnit": "MHz"}, 1e-6),
        ({"FrequencyUnit": "rpm"}, 60.0),
        ({"FrequencyUnit": "rad/TimeUnit"}, 2 * np.pi),
        ({"FrequencyUnit": "rad/TimeUnit", "TimeUnit": "milliseconds"}, 2e-3 * np.pi),
        ({"FrequencyUnit": "cycles/TimeUnit"}, 1.0),
        ({"FrequencyUnit": "cycles/TimeUnit", "TimeUnit": "minutes"}, 60.0),
        ({"FrequencyUnit": "Hz", "TimeUnit": "minutes"}, 1.0),
        ({"FrequencyUnit": None, "Units": "Hz"}, 1.0),
        ({"FrequencyUnit": None, "Units": "rad/s"}, 2 * np.pi),
        ({"FrequencyUnit": None}, 2 * np.pi),
    ],
)
def test_frequencies_are_in_the_unit_that_the_object_says(tmp_path, fields, factor):
    path = saved(tmp_path / "g.mat", Frequency=FREQUENCY[:, None] * factor, **fields)
    np.testing.assert_allclose(read(path).frequency_hz, FREQUENCY, rtol=IDENTITY)
    np.testing.assert_allclose(read(path).response, RESPONSE.transpose(2, 0, 1), rtol=IDENTITY)
    assert recognise(path).highest_hz == pytest.approx(FREQUENCY[-1])


def test_a_unit_that_is_stated_beside_the_file_counts(tmp_path):
    path = saved(tmp_path / "g.mat", Frequency=FREQUENCY[:, None])
    found = read(path, frequency=FrequencyColumn(unit="Hz"))
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=IDENTITY)


DELAYS = {"InputDelay": np.array([[1.0], [2.0]]), "OutputDelay": np.array([[10.0], [20.0]])}


@pytest.mark.parametrize(
    ("fields", "unit_s"),
    [
        ({"Ts": 0.0}, 1.0),
        ({"Ts": 0.0, "TimeUnit": "milliseconds", "FrequencyUnit": "rad/s"}, 1e-3),
        ({"Ts": 0.004}, 0.004),
        ({"Ts": 4.0, "TimeUnit": "milliseconds", "FrequencyUnit": "rad/s"}, 0.004),
    ],
)
def test_delays_of_the_object_are_in_its_time_unit_or_in_samples(tmp_path, fields, unit_s):
    between = np.array([[0.0, 3.0], [5.0, 7.0]])
    path = saved(tmp_path / "g.mat", **DELAYS, IODelay=between, **fields)
    delay_s = unit_s * (between + np.array([[11, 12], [21, 22]]))
    late = RESPONSE * np.exp(-1j * OMEGA * delay_s[..., None])
    np.testing.assert_allclose(read(path).response, late.transpose(2, 0, 1), rtol=IDENTITY, atol=IDENTITY)


def test_the_error_of_a_number_is_that_of_both_its_parts(tmp_path):
    generator = np.random.default_rng(1)
    root = generator.normal(size=(2, 2, 40, 2, 2))
    covariance = root @ root.swapaxes(-1, -2)
    found = read(saved(tmp_path / "g.mat", CovarianceData=covariance)).variance
    np.testing.assert_allclose(found, np.trace(covariance, axis1=3, axis2=4).transpose(2, 0, 1), rtol=IDENTITY)
    assert read(saved(tmp_path / "g.mat")).variance is None


def test_one_element_keeps_its_place_though_axes_of_length_one_are_dropped(tmp_path):
    one = {"ResponseData": RESPONSE[0, 0][:, None], "InputName": "u", "OutputName": "x"}
    plain = {"InputDelay": 0.0, "OutputDelay": 0.0, "IODelay": 0.0}
    savemat(tmp_path / "g.mat", {"G": {"Frequency": OMEGA, "Ts": 0.002, **one, **plain}})
    found = robid.read_responses(tmp_path / "g.mat", inputs=[{"name": "u"}], outputs=[{"name": "x", "unit": "rad/s^2"}])
    np.testing.assert_allclose(found.response[0, :, 0, 0], RESPONSE[0, 0], rtol=IDENTITY)
    assert any("0.002" in note and "hold" in note for note in found.notes)


AXIS = {"inputs": [{"name": name} for name in "uv"], "outputs": [{"name": name, "unit": "rad/s^2"} for name in "xy"]}


def test_a_period_that_contradicts_the_stated_one_is_refused(tmp_path):
    path = saved(tmp_path / "g.mat", Ts=2.0, TimeUnit="milliseconds", FrequencyUnit="rad/s")
    same = robid.read_responses(path, **AXIS, sampling_period_s=0.002)
    assert same.hold_period_s == 0.002
    assert not any("hold" in note for note in same.notes)
    with pytest.raises(DataError, match="D622"):
        robid.read_responses(path, **AXIS, sampling_period_s=0.001)


@pytest.mark.parametrize(
    ("code", "fields"),
    [
        ("D662", {"Ts": -1.0, **DELAYS}),
        ("D663", {"FrequencyUnit": "furlongs"}),
        ("D664", {"TimeUnit": "fortnights"}),
        ("D665", {"ResponseData": np.stack([RESPONSE, RESPONSE, RESPONSE], axis=3)}),
        ("D635", {"CovarianceData": np.zeros((2, 2, 39, 2, 2))}),
        ("D635", {"IODelay": np.zeros((3, 2))}),
        ("D616", {"InputName": np.array(["u", "w"], object)[:, None]}),
    ],
)
def test_what_contradicts_itself_is_named(tmp_path, code, fields):
    path = saved(tmp_path / "g.mat", **fields)
    with pytest.raises(DataError) as refused:
        robid.read_responses(path, **AXIS)
    assert code in refused.value.codes
    assert refused.value.remedy

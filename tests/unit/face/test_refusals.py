"""What arrays in memory are refused for, each with its code; and what objects say of themselves."""

import numpy as np
import pytest

import robid
from exact_systems import two_mass_robot

STEP_S, N = 1e-3, 500
LINES_HZ = np.arange(10, 41) * 2.0
ARM = robid.RobotModel(two_mass_robot(), STEP_S)


def record(seed=1, **changed):
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(N // 2 + 1, complex)
    spectrum[10:41] = np.exp(2j * np.pi * rng.uniform(size=31))
    torque = np.broadcast_to(np.fft.irfft(spectrum)[None, :, None], (2, N, 1))
    angle = torque + 1e-3 * rng.normal(size=torque.shape)
    given = {"inputs": torque, "outputs": angle, "sampling_period_s": STEP_S, "frequency_hz": LINES_HZ} | changed
    return robid.make_record(given.pop("inputs"), given.pop("outputs"), given.pop("sampling_period_s"), **given)


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"inputs": np.where(np.arange(N) == 7, np.nan, 1.0)[None, :, None] * np.ones((2, N, 1))}, "D501"),
        ({"sampling_period_s": 1.0}, "D502"),
        ({"output_quantity": "deg"}, "D503"),
    ],
)
def test_arrays_that_cannot_be_a_record_are_refused_by_code(changed, code):
    with pytest.raises(robid.DataError, match=code):
        record(**changed)


def test_the_first_value_that_is_no_number_is_said():
    values = np.ones((2, N, 1))
    values[1, 7, 0] = np.inf
    with pytest.raises(robid.DataError, match=r"\(1, 7, 0\)"):
        record(outputs=values)


def test_a_fit_is_not_validated_on_what_it_has_read():
    responses = robid.estimate_frf(record())
    again = robid.estimate_frf(record())
    for other in (responses, again):
        with pytest.raises(robid.DataError, match="D500"):
            robid.fit_model("elastic", ARM, responses, validate_on=other)
    with pytest.raises(robid.DataError, match="D500"):
        robid.fit_model("rigid", ARM, [record(), record(2)], validate_on=[record(2)])


def test_records_and_responses_say_what_they_are_in_two_lines():
    for one in (record(), robid.estimate_frf(record())):
        assert len(repr(one).splitlines()) == 2
        assert "motor_1" in repr(one)
    assert "20 to 80 Hz" in repr(robid.estimate_frf(record()))


def test_names_with_dots_reach_python_control():
    control = pytest.importorskip("control")
    found = robid.to_control(robid.estimate_frf(record(names=["drive.arm"])))
    assert isinstance(found, control.FrequencyResponseData)
    assert list(found.output_labels) == ["drive_arm"]

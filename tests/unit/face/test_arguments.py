"""Arguments of a wrong type, in a wrong order, of a wrong shape: one error of robid that says what is wanted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import robid
from exact_systems import exact_frf, two_joint_robot, two_mass_robot

STEP_S = 1e-3
ARM = robid.RobotModel(two_joint_robot(), STEP_S)
PLACES = np.random.default_rng(3).uniform(-1, 1, (3, 2))
LINES = np.array([3.0, 8.0, 20.0, 45.0])
MEASURED = exact_frf(ARM.description, PLACES, LINES, declared_noise=0.01)
RECORD = robid.make_record(np.zeros((30, 2)), np.zeros((30, 2)), STEP_S)


def swapped(name, first, second):
    """The responses with two axes of an array exchanged."""
    return replace(MEASURED, **{name: np.swapaxes(getattr(MEASURED, name), first, second)})


CALLS = {
    "swapped": (lambda: robid.fit_model("elastic", MEASURED, ARM), ("RobotModel", "Frf")),
    "nothing": (lambda: robid.fit_model("elastic"), ("RobotModel", "Frf", "nothing")),
    "no responses": (lambda: robid.fit_model("elastic", ARM), ("Frf",)),
    "too much": (lambda: robid.fit_model("external", ARM, RECORD), ("Record", "RobotModel")),
    "a record for responses": (lambda: robid.fit_model("elastic", ARM, RECORD), ("Frf", "Record")),
    "responses for a record": (lambda: robid.fit_model("rigid", ARM, MEASURED), ("Frf", "Record")),
    "a path": (lambda: robid.fit_model("elastic", "kr300.yaml", MEASURED), ("kr300.yaml", "robid.load_robot(path)")),
    "validated on a record": (lambda: robid.fit_model("elastic", ARM, MEASURED, validate_on=RECORD), ("validate_on",)),
    "no rows to choose on": (lambda: robid.fit_model("lpv", MEASURED), ("choose_on",)),
    "an array for a record": (lambda: robid.estimate_frf(np.zeros((9, 2))), ("(9, 2)", "Record")),
    "a record's robot": (lambda: robid.estimate_frf(RECORD, robot="kr300"), ("robot", "kr300")),
    "a design's robot": (lambda: robid.choose_configurations("kr300", PLACES, LINES), ("robot", "kr300")),
    "a fit that is none": (lambda: ARM.with_fit(MEASURED), ("Frf", "elastic")),
    "a rigid fit": (lambda: ARM.with_fit(SimpleNamespace(kind="rigid", parameters={})), ("rigid", "elastic")),
    "a response that is none": (lambda: robid.from_control(MEASURED, STEP_S), ("Frf", "FrequencyResponseData")),
}
SHAPES = {
    "one configuration": (lambda: ARM.response(PLACES[0], LINES), ("configurations", "(2,)", "(1, 2)")),
    "joints first": (lambda: ARM.response(PLACES.T, LINES), ("configurations", "(2, 3)", "n_joint=2")),
    "two frequencies": (lambda: ARM.response(PLACES, LINES[None]), ("frequency_hz", "(1, 4)")),
    "words": (lambda: ARM.response("home", LINES), ("home",)),
    "ragged": (lambda: robid.make_record([[1.0], [1.0, 2.0]], [[1.0]], STEP_S), ("inputs", "list")),
    "candidates": (lambda: robid.choose_configurations(ARM, PLACES.T, LINES), ("candidates", "(2, 3)")),
    "channels first": (lambda: robid.make_record(np.zeros((2, 30)), np.zeros((2, 30)), STEP_S), ("inputs", "(2, 30)")),
    "frequency last": (lambda: robid.fit_model("elastic", ARM, swapped("response", 1, 3)), ("response", "frequency")),
    "configuration later": (lambda: robid.fit_model("elastic", ARM, swapped("response", 0, 1)), ("response", "4", "3")),
    "covariance": (
        lambda: robid.fit_model("elastic", ARM, swapped("total_covariance", 1, 2)),
        ("total_covariance", "frequency"),
    ),
    "names": (
        lambda: robid.fit_model("elastic", ARM, replace(MEASURED, input_channels=MEASURED.input_channels[:1])),
        ("input_channels", "input"),
    ),
    "joints of another robot": (
        lambda: robid.fit_model("elastic", robid.RobotModel(two_mass_robot(), STEP_S), MEASURED),
        ("configurations", "n_joint=1"),
    ),
    "control": (
        lambda: robid.from_control(
            SimpleNamespace(frdata=np.ones((4, 2, 2)), omega=LINES, input_labels="ab", output_labels="ab"), STEP_S
        ),
        ("(4, 2, 2)", "(2, 2, 4)"),
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_missing_or_something_else_is_said_with_what_is_wanted(name):
    call, told = CALLS[name]
    assert_told(call, "S576", told)


@pytest.mark.parametrize("name", SHAPES)
def test_a_wrong_shape_is_said_with_the_shape_that_is_wanted(name):
    call, told = SHAPES[name]
    assert_told(call, "S577", told)


def assert_told(call, code, told):
    with pytest.raises(robid.SettingsError) as refused:
        call()
    assert refused.value.codes == (code,)
    assert refused.value.remedy
    assert refused.value.where
    for word in told:
        assert word in str(refused.value)


def test_data_as_they_are_made_pass_every_check():
    fit = robid.fit_model("elastic", ARM, MEASURED, free=("stiffness", "damping"), correct_torques=False)
    assert fit.kind == "elastic"


def test_a_line_that_tells_too_little_is_not_shown_as_if_it_were_measured():
    control = pytest.importorskip("control")
    lost = np.zeros((3, 4, 2), bool)
    lost[1, 2, 0] = True
    gap = replace(MEASURED, dropped=lost)
    assert np.isnan(gap.known_response).sum() == 2
    assert np.isnan(gap.known_response[1, 2, :, 0]).all()
    assert "1 of the lines" in repr(gap)
    assert "1 of the lines" not in repr(MEASURED)
    there = robid.to_control(gap, 1)
    assert isinstance(there, control.FrequencyResponseData)
    assert np.isnan(there.frdata[:, 0, 2]).all()
    assert np.isfinite(robid.to_control(gap, 0).frdata).all()
    with pytest.raises(robid.SettingsError, match="S579"):
        robid.from_control(there, STEP_S)
    with pytest.raises(robid.SettingsError, match="S578"):
        robid.to_control(gap, 3)


def test_sections_of_options_are_mappings_as_in_the_experiment_file():
    given = {"free": ("stiffness", "damping"), "correct_torques": False}
    named = robid.fit_model("elastic", ARM, MEASURED, weights={"kind": "optimal"}, **given)
    assert named.kind == "elastic"
    with pytest.raises(robid.DataError, match="weights"):
        robid.fit_model("elastic", ARM, MEASURED, weights={"kind": "best"}, **given)
    with pytest.raises(robid.DataError, match="basis") as refused:
        robid.fit_model("lpv", MEASURED, choose_on=[0], basis={"degre": 2})
    assert refused.value.codes == ("D290",)

"""Responses that were measured elsewhere, from Python: arrays and files are one, and a plant comes back."""

import numpy as np
import pytest
from scipy.io import savemat

import robid
from exact_systems import exact_frf, two_joint_robot
from tolerances import IDENTITY

FREQUENCY = np.geomspace(1, 200, 120)
AXIS = {"inputs": [{"name": "axis", "unit": "N m"}], "outputs": [{"name": "axis", "unit": "rad"}]}
NOISE = 0.01


def plant(frequency_hz):
    """Two masses on a spring: torque to the angle of the first, 2 ms late."""
    s, w, z = 2j * np.pi * frequency_hz, 2 * np.pi * 30, 2 * np.pi * 18
    return 50 / s**2 * (1 + 0.02 * s / z + s**2 / z**2) / (1 + 0.04 * s / w + s**2 / w**2) * np.exp(-0.002 * s)


def measured(seed):
    """The plant with noise of one per cent, and its deviation."""
    response = plant(FREQUENCY)
    error = np.random.default_rng(seed).normal(size=(2, FREQUENCY.size)).T @ [1, 1j] * np.abs(response)
    return response + NOISE * error / np.sqrt(2), NOISE * np.abs(response)


def arrays(seed, **more):
    response, deviation = measured(seed)
    given = {**AXIS, "deviation": deviation, "accelerations": False, **more}
    return robid.make_responses(FREQUENCY, response, **given)


def test_a_plant_comes_back_from_arrays_and_is_graded_on_others():
    fit = robid.fit_model("external", arrays(1), validate_on=arrays(2))
    truth = {
        "axis.pole1.frequency": 2 * np.pi * 30,
        "axis.pole1.damping": 0.02,
        "axis.zero1.frequency": 2 * np.pi * 18,
        "axis.gain_per_second": 50.0,
        "axis.delay": 0.002,
    }
    for name, value in truth.items():
        one = fit.parameters[name]
        # Four standard deviations on either side.
        assert abs(value - one.value) < 2.1 * (one.upper - one.lower) / 2, name
    assert (fit.kind, fit.grade.value) == ("external", 2)
    alone = robid.fit_model("external", arrays(1), poles=4, zeros=2, integrators=2)
    assert alone.grade is None
    assert "validate_on" in alone.sentence


def test_the_residual_of_a_right_model_is_noise_of_unit_variance():
    fit = robid.fit_model("external", arrays(3))
    left = fit.residual
    assert (left.axes, left.over, left.labels) == (("frequency", "channel"), "frequency_hz", ("axis",))
    np.testing.assert_array_equal(left.measured[:, 0], measured(3)[0])
    # 2 N - 7 degrees of freedom of E|w|^2 = 1: four deviations.
    assert np.mean(np.abs(left.whitened) ** 2) == pytest.approx(1, abs=4 / np.sqrt(FREQUENCY.size))


@pytest.mark.parametrize("form", ["csv", "mat"])
def test_files_give_what_arrays_give(tmp_path, form):
    response, deviation = measured(4)
    path, channels = tmp_path / f"g.{form}", {"inputs": [{"name": "axis", "variable": "u", "unit": "N m"}]}
    if form == "csv":
        rows = np.transpose([FREQUENCY, response.real, response.imag, deviation]).tolist()
        path.write_text("\n".join(["f,re,im,std", *(",".join(map(repr, row)) for row in rows)]))
    else:
        half = np.zeros((1, 1, FREQUENCY.size, 2, 2))
        half[..., 0, 0] = half[..., 1, 1] = deviation**2 / 2
        content = {"ResponseData": response[None, None], "Frequency": 2 * np.pi * FREQUENCY, "CovarianceData": half}
        savemat(path, {"G": {**content, "InputName": "u", "OutputName": "axis"}})
    found = robid.read_responses(path, **{**AXIS, **channels}, accelerations=False)
    ours = arrays(4)
    np.testing.assert_allclose(found.response, ours.response, rtol=IDENTITY)
    np.testing.assert_allclose(found.element_variance(), ours.element_variance(), rtol=IDENTITY)
    assert any("no record" in note for note in found.notes)
    assert found.output_channels == ours.output_channels
    # Where nothing else is said, torques give accelerations.
    moved = robid.read_responses(path, **{**AXIS, **channels})
    np.testing.assert_allclose(
        moved.response[0, :, 0, 0], ours.response[0, :, 0, 0] * (2j * np.pi * FREQUENCY) ** 2, rtol=IDENTITY
    )


def test_configurations_have_files_of_their_own_and_an_elastic_fit_reads_them(tmp_path):
    robot = robid.RobotModel(two_joint_robot(), 1e-3, 0.5e-3)
    places = np.random.default_rng(3).uniform(-1, 1, (3, 2))
    lines = np.geomspace(3.0, 60.0, 12)
    exact = exact_frf(robot.description, places, lines, sampling_period_s=1e-3, declared_noise=0.01)
    names = robot.joints
    pairs = [(out, one) for out in range(2) for one in range(2)]
    elements = [
        {"output": names[out], "input": names[one], "real": f"r{out}{one}", "imaginary": f"i{out}{one}"}
        for out, one in pairs
    ]
    for index, response in enumerate(exact.response, start=1):
        columns = {"f": lines}
        for out, one in pairs:
            columns |= {f"r{out}{one}": response[:, out, one].real, f"i{out}{one}": response[:, out, one].imag}
        rows = np.transpose(list(columns.values())).tolist()
        text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)])
        (tmp_path / f"c{index}.csv").write_text(text)
    channels = {
        "inputs": [{"name": name, "unit": "N m"} for name in names],
        "outputs": [{"name": name, "unit": "rad/s^2"} for name in names],
    }
    timing = {"sampling_period_s": 1e-3, "configurations": places}
    read = robid.read_responses(tmp_path / "c{configuration}.csv", **channels, **timing, elements=elements)
    np.testing.assert_allclose(read.response, exact.response, rtol=IDENTITY)
    deviation = np.sqrt(exact.element_variance())
    made = robid.make_responses(lines, exact.response, **channels, **timing, deviation=deviation)
    np.testing.assert_allclose(made.element_variance(), exact.element_variance(), rtol=IDENTITY)
    options = {"free": ("stiffness", "damping"), "correct_torques": False, "delay_s": 0.0}
    ours, theirs = (robid.fit_model("elastic", robot, each, **options) for each in (made, exact))
    np.testing.assert_allclose(
        [one.value for one in ours.parameters.values()], [one.value for one in theirs.parameters.values()], rtol=1e-6
    )


def turned(seed):
    """The conjugate of what was measured."""
    response, deviation = measured(seed)
    return robid.make_responses(FREQUENCY, response.conj(), **AXIS, deviation=deviation, accelerations=False)


def test_a_phase_of_the_wrong_sign_is_named_in_a_fit_and_in_a_validation():
    fit = robid.fit_model("external", turned(1))
    assert fit.findings[0].cause == "units"
    assert "conjugate" in fit.findings[0].message
    assert "right half plane" in robid.fit_model("external", turned(1), stable=False).found.solution.remarks[-1]
    held = robid.fit_model("external", arrays(1), validate_on=turned(2))
    assert held.grade.causes[0] == "units"
    assert "conjugate" in held.findings[0].message


def test_what_neither_a_response_nor_its_conjugate_explains_is_no_matter_of_the_phase():
    """Too few poles, and deviations that are stated a tenth of what they are."""
    few = robid.fit_model("external", arrays(1), poles=2, delay_samples=0)
    certain = robid.fit_model("external", arrays(1, deviation=measured(1)[1] / 10))
    for fit in (few, certain):
        assert fit.found.solution.quality.widened[0] > 1
        assert not any("conjugate" in finding.message for finding in fit.findings)


REFUSED = {
    "delay": ("S640", lambda: arrays(1, delay_s=0.001)),
    "a file's option": ("S641", lambda: arrays(1, magnitude="db")),
    "no channels": ("S576", lambda: arrays(1, inputs=())),
    "a name for a channel": ("S576", lambda: arrays(1, inputs=["axis"])),
    "a channel twice": ("S610", lambda: arrays(1, outputs=[{"name": "a"}, {"name": "a"}], deviation=None)),
    "a unit that is none": ("D291", lambda: arrays(1, inputs=[{"name": "axis", "unit": "lbf"}])),
    "an option that is none": ("D290", lambda: arrays(1, average=3)),
    "configurations": ("S577", lambda: arrays(1, configurations=np.zeros((2, 1)))),
    "a deviation too short": ("S577", lambda: arrays(1, deviation=np.ones(7))),
    "words": ("S577", lambda: robid.make_responses(FREQUENCY, "none", **AXIS)),
    "frequencies that fall": ("D608", lambda: robid.make_responses(FREQUENCY[::-1], measured(1)[0], **AXIS)),
    "no file": ("D053", lambda: robid.read_responses("none.csv", **AXIS)),
    "a placeholder that is none": ("S615", lambda: robid.read_responses("c{number}.csv", **AXIS)),
    "elements of others": (
        "S613",
        lambda: robid.read_responses("g.csv", **AXIS, elements=[{"output": "lift", "input": "axis", "complex": "g"}]),
    ),
    "a choice of orders": ("D660", lambda: robid.fit_model("external", arrays(1), choose_on=arrays(2))),
    "itself": ("D500", lambda: robid.fit_model("external", arrays(1), validate_on=arrays(1))),
    "a record beside": ("S576", lambda: robid.fit_model("external", arrays(1), validate_on=RECORD)),
    "both": ("S576", lambda: robid.fit_model("external", RECORD, arrays(1))),
    "z of a response in continuous time": ("D639", lambda: robid.fit_model("external", arrays(1), time="discrete")),
}
RECORD = robid.make_record(np.zeros((30, 1)), np.zeros((30, 1)), 1e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_by_its_code(name):
    code, call = REFUSED[name]
    with pytest.raises(robid.RobidError) as refused:
        call()
    assert code in refused.value.codes
    assert refused.value.remedy
    assert refused.value.where


def test_a_line_that_is_no_number_says_nothing():
    response, deviation = measured(5)
    response[7] = np.nan
    found = robid.make_responses(FREQUENCY, response, **AXIS, deviation=deviation, accelerations=False)
    assert np.flatnonzero(np.isnan(found.known_response[0, :, 0, 0])).tolist() == [7]
    fit = robid.fit_model("external", found)
    assert fit.parameters["axis.pole1.frequency"].value == pytest.approx(2 * np.pi * 30, rel=0.01)

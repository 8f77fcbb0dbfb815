"""The Python face: what it exports, what it costs, and known truth through it."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robid
from exact_systems import two_joint_robot, two_mass_robot
from tolerances import IDENTITY
from two_mass_log import DAMPING, LINES, LOAD, MOTOR, PERIOD_S, STEP_S, STIFFNESS, two_mass

ROOT = Path(__file__).parents[3]


def recorded(seed, **changes):
    """Four realizations of four periods of the two masses, their angles with noise of a thousandth."""
    generator = np.random.default_rng(seed)
    n_sample = round(PERIOD_S / STEP_S)
    spectra = np.zeros((4, n_sample // 2 + 1), complex)
    spectra[:, LINES] = 20 * np.exp(2j * np.pi * generator.uniform(size=(4, LINES.size)))
    torque = np.fft.irfft(spectra, n_sample)
    angle = np.array([two_mass(one, STIFFNESS)[0] for one in torque])
    u, y = (np.tile(one[:, None, None, :, None], (1, 1, 4, 1, 1)) for one in (torque, angle))
    y = y + 1e-3 * y.std() * generator.normal(size=y.shape)
    return robid.make_record(u, y, STEP_S, **{"frequency_hz": LINES / PERIOD_S, "names": ["drive"], **changes})


@pytest.fixture(scope="module")
def measured():
    return robid.estimate_frf(recorded(1))


@pytest.fixture(scope="module")
def drive():
    start = two_mass_robot(MOTOR, LOAD, 0.7 * STIFFNESS, 2 * DAMPING)
    return robid.RobotModel(start, STEP_S)


def test_every_public_name_is_there_and_described():
    for name in robid.__all__:
        value = getattr(robid, name)
        assert name in dir(robid)
        assert isinstance(value, str) or inspect.getdoc(value), name
    with pytest.raises(AttributeError, match="fit_model"):
        _ = robid.fit_modle


def test_nothing_inside_imports_the_package_itself():
    for file in (ROOT / "robid").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                assert "robid" not in [one.name for one in node.names], file
            if isinstance(node, ast.ImportFrom):
                assert node.module != "robid", file


def test_importing_it_imports_nothing_and_a_fit_of_arrays_no_settings():
    code = f"""
import sys
sys.path.insert(0, {str(ROOT / "tests")!r})
import robid
assert "numpy" not in sys.modules and len(robid.__all__) > 15
from exact_systems import two_mass_robot
import numpy as np
robot = robid.RobotModel(two_mass_robot(), 1e-3)
lines = np.arange(1, 60)
values = robot.response(np.zeros((1, 1)), lines)
class Response:
    frdata, omega = values[0].transpose(1, 2, 0), 2 * np.pi * lines
    input_labels = output_labels = ["drive"]
exact = robid.from_control(Response, 1e-3)
print(robid.fit_model("elastic", robot, exact, free=("stiffness", "damping")).parameters)
assert not {{"pydantic", "ruamel.yaml", "typer", "rich", "plotly"}} & set(sys.modules), set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "coupling.stiffness" in done.stdout


def test_a_spring_comes_back_from_arrays_with_both_intervals(measured, drive):
    fit = robid.fit_model("elastic", drive, measured, free=("stiffness", "damping"))
    for name, true in (("coupling.stiffness", STIFFNESS), ("coupling.damping", DAMPING)):
        one = fit.parameters[name]
        assert one.lower < true < one.upper
        assert one.effective_lower < true < one.effective_upper
        assert one.identified
        assert one.nominal != pytest.approx(true, rel=0.1)
    assert (fit.parameters["coupling.stiffness"].unit, fit.kind) == ("N m/rad", "elastic")
    assert fit.grade is None
    assert "validate_on" in fit.sentence
    assert isinstance(next(iter(fit.parameters)), str)


def test_a_fit_is_graded_on_data_that_it_never_saw(measured, drive):
    other = robid.estimate_frf(recorded(2))
    held = robid.fit_model("elastic", drive, measured, validate_on=other, free=("stiffness", "damping"))
    assert held.grade.value == 1  # one place, measured twice
    assert "same_configuration" in [finding.cause for finding in held.findings]


def test_the_response_is_that_of_two_masses():
    lines = np.array([3.0, 40.0, 55.0])
    plain = robid.RobotModel(two_mass_robot(MOTOR, LOAD, STIFFNESS, DAMPING)).response([[0.0]], lines, continuous=True)
    s = 2j * np.pi * lines
    spring = DAMPING * s + STIFFNESS
    exact = s**2 * (LOAD * s**2 + spring) / (MOTOR * LOAD * s**4 + (MOTOR + LOAD) * s**2 * spring)
    np.testing.assert_allclose(plain[0, :, 0, 0], exact, rtol=1e-8)


def test_fitted_values_are_put_into_the_robot(measured, drive):
    fit = robid.fit_model("elastic", drive, measured, free=("stiffness", "damping"))
    found = drive.with_fit(fit)
    assert found.description.springs[0].stiffness == fit.parameters["coupling.stiffness"].value
    assert np.abs(found.response([[0.0]], measured.frequency_hz) / measured.response - 1).max() < 0.01
    assert np.abs(drive.response([[0.0]], measured.frequency_hz) / measured.response - 1).max() > 0.1


def test_a_response_goes_to_python_control_and_back(measured):
    control = pytest.importorskip("control")
    there = robid.to_control(measured)
    assert isinstance(there, control.FrequencyResponseData)
    back = robid.from_control(there, STEP_S)
    np.testing.assert_allclose(back.response, measured.response, rtol=IDENTITY)
    np.testing.assert_allclose(back.frequency_hz, measured.frequency_hz, rtol=IDENTITY)
    assert back.input_names == ("drive",)


def test_parameters_become_a_table_of_pandas(measured, drive):
    pytest.importorskip("pandas")
    fit = robid.fit_model("elastic", drive, measured, free=("stiffness", "damping"))
    table = fit.parameters.to_pandas()
    assert table.loc["coupling.stiffness", "value"] == fit.parameters["coupling.stiffness"].value
    assert table.index.tolist() == list(fit.parameters)


def test_chosen_configurations_beat_most_random_ones():
    robot = robid.RobotModel(two_joint_robot(), 1e-3, 1e-3)
    candidates = np.random.default_rng(1).uniform(-1.5, 1.5, (30, 2))
    lines = np.geomspace(3, 80, 20)
    design = robid.choose_configurations(robot, candidates, lines, 4)
    assert len(design.chosen) == 4
    assert 0.8 < design.efficiency <= 1
    same = robid.choose_configurations(robot, candidates, lines, 4, fixed=("gear_1.damping",))
    assert "gear_1.damping" in design.parameter_names
    assert "gear_1.damping" not in same.parameter_names
    ahead = robid.choose_configurations(robot, candidates, lines, 4, criterion="prediction")
    assert len(ahead.chosen) == 4
    assert ahead.parameter_names == design.parameter_names
    assert 0.5 < ahead.efficiency <= 1


@pytest.mark.parametrize(
    ("code", "call"),
    [
        (
            "D290",
            lambda: robid.fit_model(
                "elastic", robid.RobotModel(two_mass_robot()), robid.estimate_frf(recorded(1)), strats=2
            ),
        ),
        ("D293", lambda: robid.fit_model("elastc", None)),
        ("D294", lambda: robid.make_record(np.zeros((10, 1)), np.zeros((9, 1)), 1e-3)),
        ("D295", lambda: recorded(1, configurations=np.zeros((2, 1)))),
        ("D296", lambda: robid.make_record(np.zeros(10), np.zeros((10, 1)), 1e-3)),
        ("D297", lambda: recorded(1, frequency_hz=[20.5])),
        ("D298", lambda: recorded(1, names=["one", "two"])),
        ("D299", lambda: robid.choose_configurations(robid.RobotModel(two_mass_robot()), [[0.0]], [1.0])),
    ],
)
def test_what_cannot_be_is_refused_by_name(code, call):
    with pytest.raises(robid.DataError) as refused:
        call()
    assert refused.value.codes == (code,)
    assert refused.value.remedy

"""Exports of a finished run: each is read back and compared with what the run holds."""

import csv
import json
import re
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from scipy.io import loadmat

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, read_header
from robid.models.elastic.files import solution_from_artifact
from robid.models.encode import encode_mat
from tolerances import MJCF

FOLDER = "fits/elastic"
COLUMNS = ["name", "kind", "unit", "nominal", "estimate", "effective_value", "effective_lower", "effective_upper"]
COLUMNS += ["physical_value", "physical_lower", "physical_upper", "physical_relative_std", "identifiable"]
GEARS = ["gear_alone_value", "gear_alone_lower", "gear_alone_upper"]
FIELDS = ["nominal", "value", *COLUMNS[5:9], "lower", "upper", "relative_std", "identifiable"]


def solution_of(done):
    return solution_from_artifact(read_artifact(done.runs / FOLDER / "model.h5", MODEL))


def exported(done, form, *options):
    answer = done.robid("export", "small.yaml", "--format", form, *options, "--json")
    assert answer.code == 0, answer.err
    assert list(answer.json["files"].values()) == ["made"]
    return done.folder / answer.json["output"]


def wanted_rows(solution):
    names = ("names", "kinds", "units", *FIELDS)
    return list(zip(*(np.asarray(getattr(solution.estimate, name)).tolist() for name in names), strict=True))


def test_json_is_read_back_equal(done):
    content = json.loads(exported(done, "json").read_text())
    solution = solution_of(done)
    assert [tuple(row[name] for name in COLUMNS) for row in content["parameters"]] == wanted_rows(solution)
    assert (content["fit"], content["experiment"], content["status"]) == ("elastic", "small", "converged")
    assert content["fitted_utc"] == read_header(done.runs / FOLDER / "model.h5").provenance.finished_utc


def test_csv_is_read_back_equal(done):
    with exported(done, "csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header == [*COLUMNS, "meaning", "middle_moved_by", *GEARS]
    last = COLUMNS.index("identifiable")
    found = [(*row[:3], *map(float, row[3:last]), row[last] == "True") for row in rows]
    assert found == wanted_rows(solution_of(done))


def test_gears_are_told_from_what_lies_in_line_with_them(done):
    gears = solution_of(done).gears
    wanted = dict(zip(gears.names, zip(gears.value, gears.lower, gears.upper, strict=True), strict=True))
    assert set(wanted) == {"gear_turn.stiffness", "gear_lift.stiffness"}
    content = json.loads(exported(done, "json").read_text())["parameters"]
    mat = loadmat(exported(done, "mat"), squeeze_me=True)
    for row, meaning, *columns in zip(content, *(mat[name] for name in ("meaning", *GEARS)), strict=True):
        assert bool(row["meaning"]) == bool(np.size(meaning)) == (row["name"] in wanted)
        if row["name"] in wanted:
            assert tuple(row[name] for name in GEARS) == wanted[row["name"]] == tuple(columns)
        else:
            assert all(row[name] is None for name in GEARS)
            assert np.isnan(columns).all()


def test_each_value_of_a_table_lies_within_its_own_interval(done):
    with exported(done, "csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for kind in ("effective", "physical"):
        assert not [name for name in rows[0] if name in ("lower", "upper", "relative_std")]
        for row in rows:
            low, value, high = (float(row[f"{kind}_{end}"]) for end in ("lower", "value", "upper"))
            assert low <= value <= high, row["name"]


def test_mat_is_read_back_equal(done):
    content, solution = loadmat(exported(done, "mat"), squeeze_me=True), solution_of(done)
    for name, field in zip((*COLUMNS[3:], "confidence"), (*FIELDS, "confidence"), strict=True):
        np.testing.assert_array_equal(content[name], getattr(solution.estimate, field), err_msg=name)
    for name in ("frequency_hz", "measured", "modelled"):
        np.testing.assert_array_equal(content[name], getattr(solution.responses, name), err_msg=name)
    assert tuple(content["names"]) == solution.estimate.names
    assert tuple(content["units"]) == solution.estimate.units
    np.testing.assert_array_equal(content["configurations_rad"], solution.responses.configurations)
    assert tuple(content["input_names"]) == ("turn", "lift")
    deviation = np.sqrt(np.diag(content["covariance"]))
    size = np.where(np.array(solution.estimate.kinds) == "friction", 1.0, np.abs(solution.estimate.value))
    np.testing.assert_allclose(deviation, solution.estimate.relative_std * size, rtol=1e-12)
    np.testing.assert_array_equal(content["covariance"], solution.estimate.covariance)


def test_mat_of_one_configuration(done):
    content = loadmat(exported(done, "mat", "--configuration", "2"))
    assert content["measured"].shape[0] == 1
    assert content["configuration"].item() == 2
    np.testing.assert_array_equal(content["modelled"], solution_of(done).responses.modelled[1:])


def test_mjcf_has_the_fitted_response(done):
    solution = solution_of(done)
    path = exported(done, "mjcf", "--no-friction")
    frequency = 2 * np.pi * solution.responses.frequency_hz
    # What is compared is continuous: hold, delay and aliases are taken out by the state space of the same fit.
    state = loadmat(exported(done, "statespace"), squeeze_me=True)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1e-5
    data, n = mujoco.MjData(model), model.nv
    motors = [model.joint(f"q_m_{name}").dofadr[0] for name in ("turn", "lift")]
    for index in range(2):
        mujoco.mj_resetDataKeyframe(model, data, model.key(f"configuration_{index + 1}").id)
        A, B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, model.nu))
        mujoco.mjd_transitionFD(model, data, 1e-4, True, A, B, None, None)
        for omega in frequency:
            point = np.exp(1j * omega * 1e-5)
            found = -(omega**2) * np.linalg.solve(point * np.eye(2 * n) - A, B)[motors]
            inner = np.linalg.solve(1j * omega * np.eye(2 * n) - state["A"][index], state["B"][index])
            wanted = (state["C"][index] @ inner + state["D"][index])[-2:]
            large = np.abs(wanted) > 1e-9 * np.abs(wanted).max()
            assert np.abs(found / wanted - 1)[large].max() < MJCF


@pytest.mark.parametrize("suffix", [".mat", ".json", ".npz"])
def test_sampled_state_space_has_the_fitted_response(done, suffix):
    path, solution = exported(done, "statespace", "--output", f"linear{suffix}"), solution_of(done)
    if suffix == ".mat":
        content = loadmat(path, squeeze_me=True)
    elif suffix == ".npz":
        content = dict(np.load(path))
    else:
        content = {name: np.array(value) for name, value in json.loads(path.read_text()).items()}
    frf = frf_from_artifact(read_artifact(done.runs / "estimation" / "frf.h5", FRF))
    assert content["sampling_period_s"] == frf.sampling_period_s
    assert content["delay_s"] == dict(zip(solution.estimate.names, solution.estimate.value, strict=True))["delay"]
    assert content["A_sampled"].shape[1] == len(content["states_sampled"]) > len(content["states"])
    for index, wanted in enumerate(solution.responses.modelled):
        found = []
        for frequency in solution.responses.frequency_hz:
            omega = 2 * np.pi * frequency
            point = np.exp(1j * omega * frf.sampling_period_s) * np.eye(content["A_sampled"].shape[1])
            inner = np.linalg.solve(point - content["A_sampled"][index], content["B_sampled"][index])
            found.append(-(omega**2) * (content["C_sampled"][index] @ inner)[:2])
        # The fit sums two aliases on each side, and its statics lag the last step of the springs.
        assert np.abs(np.array(found) - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_mjcf_says_what_it_is(done):
    text = exported(done, "mjcf", "--configuration", "2").read_text()
    root = ElementTree.fromstring(text)
    assert [key.get("name") for key in root.iter("key")] == ["configuration_2"]
    assert {"friction_turn", "friction_lift"} <= {element.get("name") for element in root.iter("general")}
    comment = re.search(r"<!--(.*?)-->", text, re.DOTALL).group(1)
    date = read_header(done.runs / FOLDER / "model.h5").provenance.finished_utc
    values = solution_of(done).estimate.found
    delay = f"delay of {1e3 * values['delay']:.4g} ms"
    assert values["delay"] == pytest.approx(1e-3, rel=0.05)
    for part in ("two-joint arm", "experiment small, fit elastic", date, "torque in N m", delay, "turn.lag"):
        assert part in comment
    tendon = next(element for element in root.iter("fixed") if element.get("name") == "gear_lift")
    assert float(tendon.get("stiffness")) == pytest.approx(values["gear_lift.stiffness"], rel=1e-11)
    assert float(tendon.get("damping")) == pytest.approx(values["gear_lift.damping"], rel=1e-11)


def test_the_same_export_is_left_alone_and_another_needs_force(done):
    path = exported(done, "mat")
    assert path == done.runs / FOLDER / "export" / "model.mat"
    before = path.read_bytes()
    again = done.robid("export", "small.yaml", "--format", "mat", "--json").json
    assert again["files"] == {again["output"]: "fresh"}
    path.write_bytes(before + b"edited")
    answer = done.robid("export", "small.yaml", "--format", "mat")
    assert answer.code == 3
    assert "--force" in answer.flat
    assert path.read_bytes() == before + b"edited"
    assert done.robid("export", "small.yaml", "--format", "mat", "--force").code == 0
    assert path.read_bytes() == before


def test_mat_files_do_not_tell_the_time_or_the_platform():
    assert encode_mat({"x": np.eye(2)})[:116].rstrip() == b"MATLAB 5.0 MAT-file, written by robid"


def test_what_does_not_go_together_is_said_at_once(done):
    answer = done.robid(
        "export", "small.yaml", "--format", "csv", "--output", "x.mat", "--configuration", "1", "--friction"
    )
    assert answer.code == 2
    for part in ("must end with .csv", "`--friction`", "S098"):
        assert part in answer.flat
    answer = done.robid("export", "small.yaml", "--format", "mjcf", "--configuration", "3")
    assert answer.code == 2
    assert "no configuration 3 (it has 1, 2)" in answer.flat
    assert done.robid("export", "small.yaml", "--format", "step").code == 2
    answer = done.robid("export", "small.yaml", "--format", "csv", "--fit", "none")
    assert (answer.code, "has no fit `none`" in answer.flat) == (2, True)


def test_a_missing_or_stale_model_names_the_command(shop, done):
    del done
    shop.change("starts: 2", "starts: 3")
    answer = shop.robid("export", "small.yaml", "--format", "csv")
    assert answer.code == 3
    assert "robid fit small.yaml --fit elastic" in answer.flat


def test_configurations_keep_the_number_of_their_campaign(done):
    done.change("from: estimation, validate_on", "from: estimation, configurations: [2], validate_on")
    assert done.robid("fit", "small.yaml", "--force").code in (0, 5)
    text = exported(done, "mjcf").read_text()
    assert "configuration_2" in text
    assert "configuration_1" not in text
    answer = done.robid("export", "small.yaml", "--format", "mat", "--configuration", "1")
    assert (answer.code, "has no configuration 1 (it has 2)" in answer.flat) == (2, True)


def test_values_that_make_no_mechanical_model(done, monkeypatch):
    def refuse(*_args, **_kwargs):
        raise ValueError("inertia must satisfy A + B >= C")

    monkeypatch.setattr("robid.models.elastic.mechanics.build_model", refuse)
    answer = done.robid("export", "small.yaml", "--format", "mjcf")
    assert answer.code == 4
    assert "A + B >= C" in answer.flat

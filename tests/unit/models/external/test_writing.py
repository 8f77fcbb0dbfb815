"""Every format holds the transfer functions that were fitted; python-control gets them as its own."""

import builtins
import csv
import io
import json
from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy.io import loadmat

from external_loops import BANDS, NEW_BAND, PERIOD_S, channels, linear, shot_of
from robid.artifacts.artifact import Provenance
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import ArtifactError, SettingsError
from robid.models.external.family import EXTERNAL
from robid.models.external.files import (
    model_of,
    solution_from_artifact,
    transfer_functions,
    validation_from_artifact,
    validation_of,
)
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.validating import validate_external
from robid.models.family import ExportTask

PLANTS = [linear([3.0, 400.0], [1.0, 22.0, 400.0], 3), linear([900.0], [1.0, 40.0, 900.0], 3)]
NAMES = ("X", "Y")
OMEGA = np.geomspace(0.1, 200, 50)


@pytest.fixture(scope="module", params=["diagonal", "full"])
def solution(request):
    options = ExternalOptions(poles=2, zeros=1, delay_samples=3, matrix=request.param)
    shots = [shot_of(PLANTS, band, moving=index) for band in BANDS for index in (0, 1)]
    return fit_external(shots, channels(NAMES, "position_command"), channels(NAMES), "zoh", options)


@pytest.fixture
def model(solution, tmp_path):
    artifact = model_of(solution, assess_external(solution, ExternalOptions()))
    path = tmp_path / "model.h5"
    write_artifact(path, artifact)
    return path


def written(model, name):
    loaded = SimpleNamespace(robot=SimpleNamespace(name="arm"), experiment=SimpleNamespace(name="chirps"))
    task = ExportTask(SimpleNamespace(loaded=loaded, name="own"), read_artifact(model, MODEL), None, None, "")
    return EXTERNAL.exports[name].make(task)


def responses(solution):
    """Response of each channel without its delay, by name."""
    found = {}
    for block in range(len(solution.transfers.blocks)):
        model = solution.transfer(block)
        whole = model.response(OMEGA) * np.exp(1j * OMEGA * model.delay_samples * PERIOD_S)[:, None, None]
        columns = whole.reshape(len(OMEGA), -1).T
        names = (solution.transfers.names[channel] for channel in solution.transfers.channels_of(block))
        found |= dict(zip(names, columns, strict=True))
    return found


def test_a_solution_and_its_validation_come_back(solution, model, tmp_path):
    again = solution_from_artifact(read_artifact(model, MODEL))
    assert again.transfers.names == solution.transfers.names
    assert again.tried == solution.tried
    assert again.agreements == solution.agreements
    for block in range(len(solution.transfers.blocks)):
        np.testing.assert_array_equal(again.transfer(block).numerator, solution.transfer(block).numerator)
        assert again.transfer(block).hold == "zoh"
    validation = validate_external(again, [shot_of(PLANTS, NEW_BAND, 77)])
    path = tmp_path / "validation.h5"
    write_artifact(path, validation_of(validation))
    back = validation_from_artifact(read_artifact(path, VALIDATION))
    assert back.bounds == validation.bounds
    np.testing.assert_allclose(back.traces.predicted, validation.traces.predicted, rtol=1e-6, atol=1e-9)


def test_json_holds_the_polynomials_and_their_covariance(solution, model):
    content = json.loads(written(model, "json"))
    expected = responses(solution)
    assert content["sampling_period_s"] == PERIOD_S
    for block in content["blocks"]:
        assert block["delay_samples"] == 3
        count = len(block["denominator"]) - 1 + sum(len(channel["numerator"]) for channel in block["channels"])
        assert np.shape(block["covariance"]) == (count, count)
        for channel in block["channels"]:
            found = np.polyval(channel["numerator"], 1j * OMEGA) / np.polyval(block["denominator"], 1j * OMEGA)
            np.testing.assert_allclose(found, expected[channel["name"]], rtol=1e-9)
    assert {row["name"] for row in content["parameters"]} == set(solution.estimate.names)


def test_csv_and_mat_hold_the_same(solution, model):
    expected = responses(solution)
    rows = list(csv.DictReader(io.StringIO(written(model, "csv").decode())))
    for name, response in expected.items():
        values = {
            word: sum(
                float(row["value"]) * (1j * OMEGA) ** int(row["power"])
                for row in rows
                if (row["channel"], row["polynomial"]) == (name, word)
            )
            for word in ("numerator", "denominator")
        }
        np.testing.assert_allclose(values["numerator"] / values["denominator"], response, rtol=1e-9)
    stated = [float(row["std"]) for row in rows if row["polynomial"] == "denominator"]
    assert min(stated) == 0.0
    content = loadmat(io.BytesIO(written(model, "mat")))
    names = [str(cell[0][0]) for cell in content["channels"]]
    for index, name in enumerate(names):
        above, below = (np.polyval(content[word][index], 1j * OMEGA) for word in ("numerator", "denominator"))
        np.testing.assert_allclose(above / below, expected[name], rtol=1e-9)
    np.testing.assert_array_equal(content["delay_samples"].ravel(), 3)


def test_every_format_tells_timing_and_deviations(model):
    rows = list(csv.DictReader(io.StringIO(written(model, "csv").decode())))
    timing = ("delay_samples", "hold", "moving_average_samples")
    assert {tuple(row[name] for name in timing) for row in rows} == {("3", "zoh", "1")}
    assert {float(row["sampling_period_s"]) for row in rows} == {PERIOD_S}
    content = loadmat(io.BytesIO(written(model, "mat")))
    channels_of = {
        channel["name"]: (block, place)
        for block in json.loads(written(model, "json"))["blocks"]
        for place, channel in enumerate(block["channels"])
    }
    for index, cell in enumerate(content["channels"]):
        block, place = channels_of[str(cell[0][0])]
        expected = np.sqrt(np.diag(block["covariance"]))
        above = len(block["channels"][place]["numerator"])
        np.testing.assert_allclose(
            content["numerator_std"][index][-above:], expected[place * above : (place + 1) * above]
        )
        np.testing.assert_allclose(content["denominator_std"][index][-2:], expected[-2:])
        assert content["denominator_std"][index][-3] == 0


def test_python_control_gets_them_as_its_own(solution, model):
    found, script = transfer_functions(model), {}
    exec(compile(written(model, "control"), "transfer_functions.py", "exec"), script)
    for name, response in responses(solution).items():
        assert isinstance(found[name], control.TransferFunction)
        np.testing.assert_allclose(found[name](1j * OMEGA), response, rtol=1e-9)
        np.testing.assert_allclose(script["TRANSFER_FUNCTIONS"][name](1j * OMEGA), response, rtol=1e-9)
        assert script["DELAY_S"][name] == pytest.approx(3 * PERIOD_S)
    late = transfer_functions(model, pade_order=4)["X"]
    slow = OMEGA[OMEGA < 50]
    expected = found["X"](1j * slow) * np.exp(-3j * PERIOD_S * slow)
    np.testing.assert_allclose(late(1j * slow), expected, atol=1e-3)


def test_python_control_is_asked_for_by_name(model, monkeypatch):
    whole = builtins.__import__

    def without(name, *rest, **more):
        if name == "control":
            raise ImportError(name)
        return whole(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(SettingsError, match="not installed") as told:
        transfer_functions(model)
    assert "pip install robid[control]" in told.value.remedy


def test_a_model_of_another_family_has_no_transfer_functions(model, tmp_path):
    artifact = read_artifact(model, MODEL)
    other = type(artifact)(
        artifact.kind, artifact.datasets, {**artifact.attributes, "family": "rigid"}, Provenance("fit")
    )
    write_artifact(tmp_path / "other.h5", other)
    with pytest.raises(ArtifactError, match="family rigid"):
        transfer_functions(tmp_path / "other.h5")

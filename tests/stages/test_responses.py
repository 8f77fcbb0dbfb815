"""Responses without a record: exported in each format and read back, the same fit; and what cannot be asked of them."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import loadmat, savemat

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.models.elastic.files import solution_from_artifact

FILES = {
    "csv": "export/frf_c{configuration}.csv",
    "mat": "export/frf.mat",
    "json": "export/frf.json",
    "uff": "export/frf.uff",
    "h5": "frf.h5",
}


def given(shop, form, **more):
    """An experiment file that has the responses of another one's run alone."""
    content = yaml.safe_load((shop.folder / "small.yaml").read_text())
    channels = [{"name": name, "variable": name} for name in ("turn", "lift")]
    frf = frf_from_artifact(read_artifact(shop.runs / "estimation/frf.h5", FRF))
    places = {"estimation": np.rad2deg(frf.configurations).tolist(), "validation": [[20.0, 30.0]]}
    for name, place in places.items():
        source = {
            "file": f"runs/small/{name}/{FILES[form]}",
            "inputs": channels,
            "outputs": [{**each, "unit": "rad/s^2"} for each in channels],
            "sampling_period_s": frf.sampling_period_s,
            "delay_s": 0.001,
            **more,
        }
        content["campaigns"][name] = {"configurations": {"list_deg": place}, "source": {"response": source}}
    content["name"] = f"given_{form}"
    del content["designs"], content["campaigns"]["candidates"]
    path = shop.folder / f"given_{form}.yaml"
    path.write_text(yaml.safe_dump(content))
    return path.name


def solution(shop, run):
    return solution_from_artifact(read_artifact(shop.folder / f"runs/{run}/fits/elastic/model.h5", MODEL))


def exported(shop):
    for name in ("estimation", "validation"):
        for form in ("csv", "mat", "json", "uff"):
            command = ("export", "small.yaml", "--campaign", name, "--what", "frf", "--format", form)
            assert shop.robid(*command).code == 0
    return shop


@pytest.mark.parametrize("form", ["mat", "json", "h5"])
def test_a_response_that_carries_its_covariance_gives_the_same_fit(done, form):
    shop = exported(done)
    answer = shop.robid("run", given(shop, form))
    assert answer.code in (0, 5), answer.err
    assert "no record" in answer.err
    ours, theirs = solution(shop, "small"), solution(shop, f"given_{form}")
    assert ours.estimate.names == theirs.estimate.names
    np.testing.assert_allclose(theirs.estimate.value, ours.estimate.value, rtol=1e-9)
    np.testing.assert_allclose(theirs.internal.covariance, ours.internal.covariance, rtol=1e-6, atol=1e-12)
    assert not (shop.folder / f"runs/given_{form}/estimation/record.h5").exists()


@pytest.mark.parametrize(("form", "rounding"), [("csv", 1e-9), ("uff", 1e-4)])
def test_tables_and_universal_files_give_it_up_to_their_digits(done, form, rounding):
    """They have deviations of elements alone, and nothing of torques that were compensated."""
    shop = exported(done)
    shop.change("validate_on: validation, starts: 2", "validate_on: validation, starts: 2, correct_torques: false")
    assert shop.robid("run", "small.yaml").code in (0, 5)
    answer = shop.robid("run", given(shop, form))
    assert answer.code in (0, 5), answer.err
    ours, theirs = solution(shop, "small"), solution(shop, f"given_{form}")
    np.testing.assert_allclose(theirs.estimate.value, ours.estimate.value, rtol=rounding, atol=1e-9)


def test_status_says_which_files_there_are_and_that_they_changed(done):
    shop = exported(done)
    shop.experiment = given(shop, "mat")
    assert shop.robid("run", shop.experiment).code in (0, 5)
    states = shop.states()
    assert states["estimation/files.h5"][0] == "fresh"
    assert "estimation/record.h5" not in states
    assert "estimation/excitation.h5" not in states
    file = shop.runs / "estimation/export/frf.mat"
    file.write_bytes((shop.runs / "validation/export/frf.mat").read_bytes())
    states = shop.states()
    assert states["estimation/files.h5"][0] == "stale"


@pytest.mark.parametrize(
    ("code", "change"),
    [
        ("D634", lambda text: text.replace("runs/small/validation/export", "runs/small/estimation/export")),
        (
            "D633",
            lambda text: text.replace(
                "      - - 20.0\n        - 30.0\n", "      - [20.0, 30.0]\n      - [0.0, 10.0]\n"
            ),
        ),
        ("D616", lambda text: text.replace("variable: lift", "variable: lifting")),
        ("D622", lambda text: text.replace("sampling_period_s: 0.001", "sampling_period_s: 0.002")),
        (
            "S612",
            lambda text: text.replace("  validation:\n", "  validation:\n    estimate: {compensation: nominal}\n", 1),
        ),
        ("S610", lambda text: text.replace("name: lift", "name: turn")),
        ("D197", lambda text: text.replace("export/frf.mat", "export/none.mat")),
    ],
)
def test_what_cannot_be_is_refused_by_name(done, code, change):
    shop = exported(done)
    name = given(shop, "mat")
    text = (shop.folder / name).read_text()
    if code == "D634":
        text = text.replace("list_deg:\n      - - 20.0\n        - 30.0", "list_deg: [[20, 30], [10, 0]]")
    changed = change(text)
    assert changed != text
    (shop.folder / name).write_text(changed)
    answer = shop.robid("run", name)
    assert answer.code in (2, 3, 4), answer.out
    assert code in answer.err


def test_families_and_designs_that_need_more_are_refused(done):
    shop = exported(done)
    name = given(shop, "mat")
    content = yaml.safe_load((shop.folder / name).read_text())
    content["fits"]["rigid"] = {"family": "rigid", "from": "estimation"}
    content["designs"] = {"best": {"campaign": "estimation", "count": 1}}
    (shop.folder / name).write_text(yaml.safe_dump(content))
    answer = shop.robid("run", name)
    assert answer.code == 2
    assert "S616" in answer.err
    assert "S617" in answer.err


@pytest.mark.parametrize("form", ["csv", "mat", "json", "uff"])
def test_inspect_proposes_what_reads_the_responses(done, form):
    """The proposal of one configuration, followed as it is: the response of the export comes back."""
    shop = exported(done)
    path = f"runs/small/validation/{FILES[form]}".replace("{configuration}", "1")
    answer = shop.robid("inspect", path, "--propose", "proposed.yaml", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["type"] == "inspect-response"
    assert (answer.json["inputs"], answer.json["outputs"]) == (["turn", "lift"], ["turn", "lift"])
    assert answer.json["error"] == "deviation"
    answer = shop.robid("run", "proposed.yaml")
    assert answer.code == 0, answer.err
    name = yaml.safe_load((shop.folder / "proposed.yaml").read_text())["name"]
    theirs = frf_from_artifact(read_artifact(shop.folder / f"runs/{name}/measured/frf.h5", FRF))
    ours = frf_from_artifact(read_artifact(shop.runs / "validation/frf.h5", FRF))
    np.testing.assert_allclose(theirs.response, ours.response, rtol=1e-9)
    np.testing.assert_allclose(theirs.element_variance(), ours.element_variance(), rtol=1e-9)


def test_logs_are_not_taken_for_responses(done, tmp_path):
    """Columns of such names whose first one does not rise as frequencies do."""
    rows = "\n".join(f"{t},{t % 7},{t % 3}" for t in [5, 3, 4, 1, 2] * 40)
    (tmp_path / "log.csv").write_text(f"f,re,im\n{rows}\n")
    answer = done.robid("inspect", str(tmp_path / "log.csv"), "--json")
    assert answer.code == 0, answer.err
    assert answer.json["type"] == "inspect-log"


def test_position_dependent_models_are_the_same(shop):
    """An lpv fit of responses that were exported is that of the campaign's own."""
    text = (Path(__file__).parent / "turk.yaml").read_text().partition("study:")[0]
    (shop.folder / "turk.yaml").write_text(text + "execution: {backend: serial, workers: 1}\n")
    assert shop.robid("run", "turk.yaml").code in (0, 5)
    content = yaml.safe_load((shop.folder / "turk.yaml").read_text())
    for name in ("local", "left_out"):
        export = ("export", "turk.yaml", "--campaign", name, "--what", "frf", "--format", "mat")
        assert shop.robid(*export).code == 0
        channels = [{"name": joint, "variable": joint} for joint in ("turn", "lift")]
        source = {
            "file": f"runs/turk/{name}/export/frf.mat",
            "inputs": channels,
            "outputs": [{**each, "unit": "rad/s^2"} for each in channels],
            "sampling_period_s": 0.001,
            "delay_s": 0.001,
        }
        campaign = content["campaigns"][name]
        content["campaigns"][name] = {"configurations": campaign["configurations"], "source": {"response": source}}
    content["name"] = "given"
    (shop.folder / "given.yaml").write_text(yaml.safe_dump(content))
    answer = shop.robid("run", "given.yaml")
    assert answer.code in (0, 5), answer.err
    ours, theirs = (read_artifact(shop.folder / f"runs/{run}/fits/own/model.h5", MODEL) for run in ("turk", "given"))
    values = [each.datasets["estimate/value"].values for each in (ours, theirs)]
    np.testing.assert_allclose(values[1], values[0], rtol=1e-9, atol=1e-12)


def test_an_inverse_response_is_named(done):
    """Torque per acceleration: its inverse is what the robot file says."""
    shop = exported(done)
    name = given(shop, "mat")
    path = shop.runs / "estimation/export/frf.mat"
    content = {key: value for key, value in loadmat(path).items() if not key.startswith("__")}
    inverse = np.linalg.inv(content["response"])
    savemat(path, {**content, "response": inverse, "variance": np.abs(inverse) ** 2 * 1e-4})
    answer = shop.robid("run", name)
    assert answer.code == 4
    assert "D642" in answer.err

"""Experiments without fits, and responses for other programs: read back equal, refused by name."""

import csv
import json

import numpy as np
import pytest
from scipy.io import loadmat

from robid import errors
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact


def frf_of(done):
    return frf_from_artifact(read_artifact(done.runs / "estimation" / "frf.h5", FRF))


def exported(done, form, *options):
    command = ("export", "small.yaml", "--campaign", "estimation", "--what", "frf", "--format", form)
    answer = done.robid(*command, *options, "--json")
    assert answer.code == 0, answer.err
    assert set(answer.json["files"].values()) == {"made"}
    return [done.folder / path for path in answer.json["files"]]


def test_an_experiment_without_fits_ends_with_its_responses(shop):
    shop.change("fits:\n  elastic: {family: elastic, from: estimation, validate_on: validation, starts: 2}\n", "")
    shop.change(
        "designs:\n  best: {campaign: candidates, between_relative_std: {stiffness: 0, damping: 0}, count: 2}\n", ""
    )
    shop.change("{from: best}", "{list_deg: [[20, 30]]}")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    assert "estimation: 2 x 2 response at 14 lines from 6.00 to 78.0 Hz, known to" in answer.out
    assert "No fit was asked for; the responses of 2 campaigns are measured and known: estimation to" in answer.out
    page = (shop.runs / "report.html").read_text()
    assert '<section id="responses">' in page
    assert "How well the responses are known" in page
    summary = json.loads((shop.runs / "summary.json").read_text())
    assert 0 < summary["campaigns.estimation.response.median_relative_std"] < 0.01
    assert summary["campaigns.estimation.response.dropped_lines"] == 0


def test_tables_are_read_back_equal(done):
    frf = frf_of(done)
    paths = exported(done, "csv")
    assert [path.name for path in paths] == ["frf_c1.csv", "frf_c2.csv"]
    for index, path in enumerate(paths):
        lines = path.read_text().splitlines()
        header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
        table = dict(zip(header, np.array(rows, float).T, strict=True))
        np.testing.assert_array_equal(table["frequency [Hz]"], frf.frequency_hz)
        deviation = np.sqrt(frf.element_variance())
        for row, output in enumerate(("turn", "lift")):
            for column, name in enumerate(("turn", "lift")):
                real, imaginary, std = (
                    table[f"{output} per {name} {part} [rad/(s^2 N m)]"] for part in ("real", "imaginary", "deviation")
                )
                np.testing.assert_array_equal(real + 1j * imaginary, frf.response[index, :, row, column])
                np.testing.assert_array_equal(std, deviation[index, :, row, column])
            np.testing.assert_array_equal(table[f"{output} multiple coherence"], frf.coherence[index, :, row])
        notes = "\n".join(line for line in lines if line.startswith("#"))
        for words in (
            "Frequency response of campaign estimation, experiment small, robid",
            f"Configuration {index + 1}: turn",
            "Output lift: motor acceleration [rad/s^2].",
            "Input turn: motor torque [N m].",
            "real and imaginary part have half of it each",
        ):
            assert words in notes


def test_mat_and_json_are_read_back_equal(done):
    frf = frf_of(done)
    (path,) = exported(done, "mat")
    assert path == done.runs / "estimation" / "export" / "frf.mat"
    found = loadmat(path)
    np.testing.assert_array_equal(found["response"], frf.response)
    np.testing.assert_array_equal(found["variance"], frf.element_variance())
    np.testing.assert_array_equal(found["frequency_hz"].ravel(), frf.frequency_hz)
    assert [str(unit[0]) for unit in found["units"].ravel()] == ["rad/(s^2 N m)"] * 4
    # The whole covariance of vec G can be put together again.
    size = np.kron(found["input_factor"][0, 3], found["output_covariance"][0, 3])
    root = np.sqrt(found["element_scale"][0].T.ravel())
    np.testing.assert_allclose(size * np.outer(root, root), frf.full_covariance(0)[3], rtol=1e-12)
    (path,) = exported(done, "json")
    content = json.loads(path.read_text())
    np.testing.assert_array_equal(
        np.array(content["response_real"]) + 1j * np.array(content["response_imaginary"]), frf.response
    )
    assert content["units"] == [["rad/(s^2 N m)"] * 2] * 2
    assert content["configuration_names"][1].startswith("Configuration 2: turn")


def test_one_configuration_keeps_its_number(done):
    (path,) = exported(done, "csv", "--configuration", "2")
    assert path.name == "frf_c2.csv"
    assert "Configuration 2: turn" in path.read_text()
    (path,) = exported(done, "json", "--configuration", "2")
    np.testing.assert_array_equal(json.loads(path.read_text())["response_real"], frf_of(done).response[1:].real)


def test_a_universal_file_is_read_back_by_its_own_package(done):
    pyuff = pytest.importorskip("pyuff", reason="the extra uff is not installed")
    frf = frf_of(done)
    (path,) = exported(done, "uff")
    units, *sets = pyuff.UFF(str(path)).read_sets()
    assert (units["type"], units["units_code"]) == (164, 1)
    assert len(sets) == 2 * frf.response[:, 0].size
    deviation = np.sqrt(frf.element_variance())
    for one in sets:
        here = one["ver_num"] - 1, slice(None), one["rsp_node"] - 1, one["ref_node"] - 1
        np.testing.assert_allclose(one["x"], frf.frequency_hz, rtol=1e-5)
        if one["func_type"] == 4:
            np.testing.assert_allclose(one["data"], frf.response[here], rtol=1e-10)
            assert (one["rsp_ent_name"], one["ref_ent_name"]) == (
                frf.output_names[here[2]],
                frf.input_names[here[3]],
            )
            assert (one["ordinate_axis_units_lab"], one["orddenom_axis_units_lab"]) == ("rad/s^2", "N m")
            assert (one["ordinate_spec_data_type"], one["orddenom_spec_data_type"]) == (12, 13)
        else:
            np.testing.assert_allclose(one["data"], deviation[here], rtol=1e-10)
            assert one["id1"].startswith("Standard deviation of ")


def test_a_missing_extra_names_the_command(done, monkeypatch):
    monkeypatch.setattr(errors, "find_spec", lambda _name: None)
    done.refuse(
        2,
        "Writing UFF58 needs the package pyuff, which is not installed",
        "install it with `pip install 'robid[uff]'`",
        command=("export", "small.yaml", "--campaign", "estimation", "--what", "frf", "--format", "uff"),
    )


def test_the_same_export_is_left_alone_and_an_edited_one_kept(done):
    for form in ("csv", "mat", "json", "uff"):
        if form == "uff":
            pytest.importorskip("pyuff", reason="the extra uff is not installed")
        path, *_ = exported(done, form)
        command = ("export", "small.yaml", "--campaign", "estimation", "--what", "frf", "--format", form)
        assert set(done.robid(*command, "--json").json["files"].values()) == {"fresh"}
        path.write_bytes(path.read_bytes() + b"\n ")
        assert done.robid(*command).code == 3
        assert done.robid(*command, "--force").code == 0
    path.write_text("of somebody else")
    assert done.robid(*command, "--force").code == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--campaign", "estimation", "--format", "mjcf"), "one of `csv`, `mat`, `json`, `uff`, not as `mjcf`"),
        (("--campaign", "estimation", "--format", "h5"), "`estimation/frf.h5` in the run folder is HDF5 already"),
        (("--campaign", "estimation", "--format", "csv", "--fit", "elastic"), "`--fit` is for a fit"),
        (("--campaign", "estimation", "--format", "mat", "--output", "x.csv"), "must end with .mat"),
        (("--campaign", "estimation", "--format", "csv", "--output", "x.csv"), "must be a folder"),
        (("--campaign", "none", "--format", "csv"), "has no campaign `none`; there are: `estimation`, `validation`"),
        (("--format", "csv"), "needs --campaign; there are: `estimation`, `validation`"),
        (("--campaign", "estimation", "--format", "csv", "--configuration", "3"), "has no configuration 3"),
    ],
)
def test_what_does_not_go_together_is_said(done, options, words):
    done.refuse(2, words, command=("export", "small.yaml", "--what", "frf", *options))


def test_what_is_about_a_campaign(done):
    words = "S002"
    done.refuse(2, words, command=("export", "small.yaml", "--what", "excitation", "--format", "csv"))


def test_responses_that_are_not_there_name_the_command(shop):
    answer = shop.robid("export", "small.yaml", "--campaign", "estimation", "--what", "frf", "--format", "csv")
    assert answer.code == 3
    assert "robid estimate-frf small.yaml --campaign estimation" in answer.flat

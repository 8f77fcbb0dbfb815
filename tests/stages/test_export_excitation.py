"""Exports of an excitation: read back equal, with what a robot needs to play them."""

import csv

import numpy as np
import pytest
from scipy.io import loadmat

from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.store import read_artifact
from robid.logs.formats.load import load_variables


def excitation_of(done):
    return excitation_from_artifact(read_artifact(done.runs / "estimation" / "excitation.h5", EXCITATION))


def exported(done, form, *options):
    answer = done.robid("export", "small.yaml", "--campaign", "estimation", "--format", form, *options, "--json")
    assert answer.code == 0, answer.err
    assert set(answer.json["files"].values()) == {"made"}
    return [done.folder / path for path in answer.json["files"]]


def test_tables_are_read_back_equal(done):
    content = excitation_of(done)
    paths = exported(done, "csv")
    assert [path.name for path in paths] == [f"excitation_r{r}_e{e}.csv" for r in (1, 2) for e in (1, 2)]
    for path, index in zip(paths, np.ndindex(2, 2), strict=True):
        lines = path.read_text().splitlines()
        notes = [line for line in lines if line.startswith("#")]
        header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
        assert header == ["time [s]", "turn [rad/s]", "lift [rad/s]"]
        table = np.array(rows, float)
        np.testing.assert_array_equal(np.float32(table[:, 1:]), np.float32(content.excitation.reference[index]))
        np.testing.assert_allclose(table[:, 0], np.arange(500) * 1e-3, atol=1e-12)
        told = "\n".join(notes)
        for words in (
            f"Realization {index[0] + 1}, experiment {index[1] + 1}.",
            "500 samples of 0.001 s, 0.5 s",
            "at least 4 periods and one to spare (2 until the steady state, 2 to record)",
            "2 realizations of 2 experiments in each of 2 configurations",
            "Configuration 2 [deg]: turn",
        ):
            assert words in told
        assert list(load_variables(path, "csv")) == header


def test_mat_is_read_back_equal(done):
    content = excitation_of(done)
    (path,) = exported(done, "mat")
    assert path == done.runs / "estimation" / "export" / "excitation.mat"
    found = loadmat(path, squeeze_me=True)
    np.testing.assert_array_equal(found["reference"], content.excitation.reference)
    np.testing.assert_array_equal(found["excited_lines"], content.excitation.excited_lines)
    np.testing.assert_array_equal(found["configurations_rad"], content.configurations)
    assert tuple(found["motor_names"]) == ("turn", "lift")
    assert (found["reference_units"], found["period_s"], found["sampling_period_s"]) == ("rad/s", 0.5, 1e-3)
    assert (found["transient_periods"], found["recorded_periods"]) == (2, 2)


def test_the_same_export_is_left_alone_and_another_folder_may_be_named(done):
    (path, *_) = exported(done, "csv")
    again = done.robid("export", "small.yaml", "--campaign", "estimation", "--format", "csv", "--json").json
    assert set(again["files"].values()) == {"fresh"}
    path.write_text("edited")
    assert done.robid("export", "small.yaml", "--campaign", "estimation", "--format", "csv").code == 3
    assert path.read_text() == "edited"
    paths = exported(done, "csv", "--output", "elsewhere")
    assert {path.parent for path in paths} == {done.folder / "elsewhere"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--format", "json"), "exported as `csv` or `mat`, not as `json`"),
        (("--format", "csv", "--fit", "elastic", "--friction"), "`--fit` is for a fit"),
        (("--format", "mat", "--output", "x.csv"), "must end with .mat"),
        (("--format", "csv", "--output", "x.mat"), "must be a folder"),
        (("--format", "csv", "--campaign", "none"), "has no campaign `none`"),
    ],
)
def test_what_does_not_go_together_is_said(done, options, words):
    answer = done.robid("export", "small.yaml", "--campaign", "estimation", *options)
    assert answer.code == 2
    assert words in answer.flat


def test_a_stale_excitation_names_the_command(done):
    done.change("rms: 6", "rms: 5")
    answer = done.robid("export", "small.yaml", "--campaign", "validation", "--format", "csv")
    assert answer.code == 3
    assert "robid design-excitation small.yaml --campaign validation --force" in answer.flat

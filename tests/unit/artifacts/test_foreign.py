"""Files in the place of ours that are damaged or lead elsewhere: each is refused as an artifact, with a remedy."""

import json
from dataclasses import asdict

import h5py
import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.atomic import read_json
from robid.artifacts.store import check_artifact, inspect_artifact, kind_of, read_artifact, read_header, write_artifact
from robid.cli import run_command
from robid.errors import ArtifactError
from robid.pipeline.freshness import read_stamp, stamped

KIND = Kind("thing", "1.0", "robid make-thing")
PROVENANCE = Provenance("make-thing", {"count": 3}, "abc", {"record": "def"}, 1, {"numpy": "2"})
VALUES = np.arange(6.0).reshape(2, 3)


@pytest.fixture
def artifact(tmp_path):
    path = tmp_path / "thing.h5"
    datasets = {"a": Dataset(VALUES, "1", ("configuration", "sample")), "deep/b": Dataset(VALUES, "1", ("x", "y"))}
    write_artifact(path, Artifact(KIND, datasets, {"size": 3}, PROVENANCE))
    return path


def scalar_for_array(file, _):
    said = dict(file["a"].attrs)
    del file["a"]
    file["a"] = 1.0
    for name, value in said.items():
        file["a"].attrs[name] = value


def elsewhere(file, other):
    del file["deep/b"]
    file["deep/b"] = h5py.ExternalLink(str(other), "/deep/b")


def attributes_elsewhere(file, other):
    del file["attributes"]
    file["attributes"] = h5py.ExternalLink(str(other), "/attributes")


def stored_elsewhere(file, other):
    said = dict(file["a"].attrs)
    del file["a"]
    stored = file.create_dataset("a", (2, 3), "<f8", external=[(str(other), 0, 48)])
    for name, value in said.items():
        stored.attrs[name] = value


def mapped_elsewhere(file, other):
    said = dict(file["a"].attrs)
    del file["a"]
    layout = h5py.VirtualLayout((2, 3), "<f8")
    layout[:] = h5py.VirtualSource(str(other), "a", (2, 3))
    for name, value in said.items():
        file.create_virtual_dataset("a", layout).attrs[name] = value
        break


def deep(file, _):
    group = file
    for _ in range(1000):
        group = group.create_group("g")


@pytest.mark.parametrize(
    "way", [scalar_for_array, elsewhere, attributes_elsewhere, stored_elsewhere, mapped_elsewhere, deep]
)
def test_an_artifact_that_lies_elsewhere_or_is_none_is_refused(artifact, tmp_path, way):
    other = tmp_path / "other.h5"
    other.write_bytes(artifact.read_bytes())
    with h5py.File(artifact, "r+") as file:
        way(file, other)
    for read in (lambda path: read_artifact(path, KIND), lambda path: check_artifact(path, KIND), inspect_artifact):
        with pytest.raises(ArtifactError) as caught:
            read(artifact)
        assert caught.value.remedy


def provenance_as(**changed):
    return json.dumps({**asdict(PROVENANCE), **changed})


BAD_PROVENANCE = {
    "surrogate": provenance_as(stage="\ud800"),
    "text for inputs": provenance_as(inputs="none"),
    "list for settings": provenance_as(settings=[]),
    "number for a hash": provenance_as(settings_hash=1),
    "other keys": provenance_as(owner="me"),
    "list": "[]",
    "nothing": "null",
    "deep": "[" * 100_000,
    "half": provenance_as()[:40],
}


@pytest.mark.parametrize("which", BAD_PROVENANCE)
def test_a_damaged_stamp_and_provenance_are_refused(artifact, tmp_path, which):
    page = tmp_path / "report.html"
    page.write_text(stamped("<body></body>", PROVENANCE))
    assert read_stamp(page) == PROVENANCE
    before = json.dumps(asdict(PROVENANCE), sort_keys=True)
    page.write_text(page.read_text().replace(before, BAD_PROVENANCE[which]))
    with pytest.raises(ArtifactError, match="A032") as caught:
        read_stamp(page)
    assert caught.value.remedy
    with h5py.File(artifact, "r+") as file:
        # Larger than what fits beside an object goes in blocks of its own.
        del file.attrs["provenance"]
        file.attrs["provenance"] = np.bytes_(BAD_PROVENANCE[which][:60_000].encode())
    with pytest.raises(ArtifactError, match="A013") as caught:
        read_header(artifact, KIND)
    assert caught.value.remedy


@pytest.mark.parametrize("name", ["kind", "schema_version", "content_sha256", "provenance"])
def test_bytes_that_are_no_text_in_a_header_are_refused(artifact, name, capsys):
    with h5py.File(artifact, "r+") as file:
        del file.attrs[name]
        file.attrs.create(name, b"\xff", dtype=h5py.string_dtype("utf-8", 1))
    for read in (read_header, inspect_artifact):
        with pytest.raises(ArtifactError) as caught:
            read(artifact)
        str(caught.value).encode()
    assert kind_of(artifact).isprintable()
    assert run_command(["inspect", str(artifact)]) in {3, 4}  # as an artifact, or as a log of somebody else
    assert "remedy" in capsys.readouterr().err


def test_json_that_does_not_end_is_damaged(tmp_path):
    (tmp_path / "a.json").write_text("[" * 100_000)
    with pytest.raises(ArtifactError, match="A003"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("folder", ["x" * 300, "/".join(["x" * 250] * 20)])
@pytest.mark.parametrize("command", ["run", "status", "fit"])
def test_a_run_folder_of_a_name_too_long_is_told(tmp_path, monkeypatch, capsys, folder, command):
    monkeypatch.chdir(tmp_path)
    experiment = "/".join([*__file__.split("/")[:-4], "configs/drive.yaml"])
    assert run_command([command, experiment, "--run-dir", folder]) == 3
    told = capsys.readouterr().err
    assert told.count("remedy") == 1
    assert "A041" in told or "A004" in told
    assert not any(tmp_path.iterdir())

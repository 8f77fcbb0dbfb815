"""Merging parts: the same as writing the whole at once, in small memory, and never half of it."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.parts import Parts
from robid.artifacts.store import read_artifact, read_header, write_artifact
from robid.errors import ArtifactError

KIND = Kind("thing", "1.0", "robid make-thing")
KEY = "0123456789abcdef"
PROVENANCE = Provenance("make-thing", {"count": 3})
LARGE = ("configuration", "sample", "channel")


def _whole(count: int, n_sample: int = 9000) -> Artifact:
    generator = np.random.default_rng(1)
    scales = 10.0 ** np.arange(count)[:, None, None]
    samples = scales * generator.standard_normal((count, n_sample, 2))
    played = np.tile(generator.standard_normal((n_sample, 2)), (count, 1, 1))
    datasets = {
        "samples": Dataset(samples, "N m", LARGE, "Torque", compact=True),
        "played": Dataset(played, "rad", LARGE, "", compact=True),
        "response": Dataset(samples[:, :50] * (1 + 1j), "rad/N", LARGE),
        "angles": Dataset(generator.standard_normal((count, 6)), "rad", ("configuration", "joint")),
        "lines": Dataset(np.arange(40), "1", ("frequency",)),
        "names": Dataset(np.array(["q1", "ß"]), "1", ("joint",)),
        "notes": Dataset(np.array(["first", "second"]), "1", ("note",)),
    }
    return Artifact(KIND, datasets, {"period_s": 0.1}, PROVENANCE)


def _parts(path: Path, whole: Artifact) -> Parts:
    parts = Parts(path, KIND, KEY)
    for index in range(len(whole.datasets["angles"].values)):
        rows = {
            name: replace(dataset, values=dataset.values[index : index + 1])
            for name, dataset in whole.datasets.items()
            if dataset.axes[0] == "configuration"
        }
        parts.write(index, replace(whole, datasets={**whole.datasets, **rows}))
    return parts


@pytest.mark.parametrize("count", [1, 3])
def test_a_merge_is_what_writing_at_once_gives(tmp_path: Path, count: int) -> None:
    whole = _whole(count)
    digest = write_artifact(tmp_path / "whole.h5", whole)
    parts = _parts(tmp_path / "thing.h5", whole)
    assert parts.merge(count, PROVENANCE) == digest == read_header(tmp_path / "thing.h5").content_sha256
    assert sorted(path.name for path in tmp_path.iterdir()) == ["thing.h5", "whole.h5"]
    merged, written = (read_artifact(tmp_path / name, KIND) for name in ("thing.h5", "whole.h5"))
    assert merged.provenance == PROVENANCE
    assert merged.attributes == written.attributes
    for name, dataset in whole.datasets.items():
        np.testing.assert_array_equal(merged.datasets[name].values, written.datasets[name].values)
        atol = 1e-7 * np.abs(dataset.values).max() if dataset.compact else 0
        if dataset.values.dtype.kind != "U":
            np.testing.assert_allclose(merged.datasets[name].values, dataset.values, rtol=0, atol=atol)


def test_one_configuration_reads_alone_as_among_all(tmp_path: Path) -> None:
    _parts(tmp_path / "thing.h5", _whole(3)).merge(3, PROVENANCE)
    every = read_artifact(tmp_path / "thing.h5", KIND)
    for row in range(3):
        alone = read_artifact(tmp_path / "thing.h5", KIND, row=row)
        for name, dataset in every.datasets.items():
            by_row = dataset.axes[0] == "configuration"
            expected = dataset.values[row : row + 1] if by_row else dataset.values
            np.testing.assert_array_equal(alone.datasets[name].values, expected)
    with pytest.raises(IndexError):
        read_artifact(tmp_path / "thing.h5", KIND, row=3)


def test_each_row_is_rounded_by_its_own_scale(tmp_path: Path) -> None:
    whole = _whole(3)
    _parts(tmp_path / "thing.h5", whole).merge(3, PROVENANCE)
    found, exact = (thing.datasets["samples"].values for thing in (read_artifact(tmp_path / "thing.h5", KIND), whole))
    for one, other in zip(found, exact, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(other).max())


def test_large_rows_that_are_all_the_same_are_stored_once(tmp_path: Path) -> None:
    _parts(tmp_path / "thing.h5", _whole(3)).merge(3, PROVENANCE)
    with h5py.File(tmp_path / "thing.h5") as file:
        assert file["played"].shape == (1, 9000, 2)
        assert file["samples"].shape == (3, 9000, 2)


def test_damage_in_one_row_refuses_that_row_and_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    _parts(path, _whole(3)).merge(3, PROVENANCE)
    with h5py.File(path, "r+") as file:
        file["samples"][1, 5, 0] *= 1.5
    for row in (0, 2):
        read_artifact(path, KIND, row=row)
    for row in (1, None):
        with pytest.raises(ArtifactError, match="does not match its hash"):
            read_artifact(path, KIND, row=row)


@pytest.mark.parametrize("attribute", ["sha256", "scale"])
def test_a_changed_hash_or_scale_of_one_row_refuses_every_row(tmp_path: Path, attribute: str) -> None:
    path = tmp_path / "thing.h5"
    _parts(path, _whole(3)).merge(3, PROVENANCE)
    with h5py.File(path, "r+") as file:
        values = file["samples"].attrs[attribute]
        values[1] = values[0]
        file["samples"].attrs[attribute] = values
    with pytest.raises(ArtifactError, match="does not match its hash"):
        read_artifact(path, KIND, row=2)


def test_notes_are_joined_and_anything_else_must_agree(tmp_path: Path) -> None:
    whole = _whole(2)
    parts = _parts(tmp_path / "thing.h5", whole)
    other = parts.read(1)
    notes = replace(whole.datasets["notes"], values=np.array(["second", "third"]))
    parts.write(1, replace(other, datasets={**other.datasets, "notes": notes}))
    parts.merge(2, PROVENANCE)
    found = read_artifact(tmp_path / "thing.h5", KIND).datasets["notes"].values
    assert found.tolist() == ["first", "second", "third"]
    lines = replace(whole.datasets["lines"], values=np.arange(1, 41))
    for change in ({"datasets": {**other.datasets, "lines": lines}}, {"attributes": {"period_s": 0.2}}):
        parts = _parts(tmp_path / "thing.h5", whole)
        parts.write(1, replace(other, **change))
        with pytest.raises(ValueError, match="of the parts differ"):
            parts.merge(2, PROVENANCE)


def test_a_part_damaged_before_the_merge_is_found_and_the_old_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    digest = write_artifact(path, _whole(1))
    parts = _parts(path, _whole(3))
    second = sorted(parts.folder.iterdir())[1]
    content = bytearray(second.read_bytes())
    content[-5000] ^= 1
    second.write_bytes(content)
    with pytest.raises(ArtifactError, match="A007") as caught:
        parts.merge(3, PROVENANCE)
    assert "the same command" in caught.value.remedy
    assert read_header(path).content_sha256 == digest
    assert [Parts(path, KIND, KEY).has(index) for index in range(3)] == [True, False, True]


def test_a_missing_part_is_an_artifact_error(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="missing"):
        _parts(tmp_path / "thing.h5", _whole(2)).merge(3, PROVENANCE)


_BREAK = """
import os, resource, signal, sys
from pathlib import Path
from robid.artifacts.artifact import Kind, Provenance
from robid.artifacts.parts import Parts
from robid.errors import ArtifactError
if sys.argv[2] == "kill":
    Path.replace = lambda *_: os._exit(9)
else:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    Parts(Path(sys.argv[1]), Kind("thing", "1.0", ""), "0123456789abcdef").merge(3, Provenance("s"))
except ArtifactError as error:
    sys.exit(error.what)
"""


@pytest.mark.parametrize("how", ["kill", "0", "1000", "60000", "200000"])
def test_a_broken_merge_leaves_the_old_file_and_all_parts(tmp_path: Path, how: str) -> None:
    path = tmp_path / "thing.h5"
    digest = write_artifact(path, _whole(1))
    _parts(path, _whole(3))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", _BREAK, str(path), how]
    done = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
    if how == "kill":
        assert done.returncode == 9
    else:
        assert done.stderr == "A001 The file cannot be written: File too large.\n"
        assert sorted(file.name for file in tmp_path.iterdir()) == ["thing.h5", "thing.h5.parts"]
    assert read_header(path).content_sha256 == digest
    again = Parts(path, KIND, KEY)
    assert all(again.has(index) for index in range(3))
    assert again.merge(3, PROVENANCE) == write_artifact(tmp_path / "whole.h5", _whole(3))

"""Parts: a killed stage resumes, and never from another stage's settings."""

from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance, canonical_hash
from robid.artifacts.parts import Parts
from robid.errors import ArtifactError

KIND = Kind("thing", "1.0", "robid make-thing")
KEY = canonical_hash({"settings": 1})


def _part(value: float) -> Artifact:
    return Artifact(KIND, {"x": Dataset(np.full(3, value), "rad", ("a",))}, {}, Provenance("make-thing"))


def test_parts_survive_and_are_read_back_by_index(tmp_path: Path) -> None:
    artifact = tmp_path / "thing.h5"
    first = Parts(artifact, KIND, KEY)
    assert not first.has(0)
    first.write(0, _part(0.5))
    first.write(2, _part(2.5))
    again = Parts(artifact, KIND, KEY)
    assert [again.has(index) for index in range(3)] == [True, False, True]
    np.testing.assert_array_equal(again.read(2).datasets["x"].values, [2.5, 2.5, 2.5])
    assert (tmp_path / "thing.h5.parts").is_dir()


def test_parts_of_another_key_are_discarded(tmp_path: Path) -> None:
    artifact = tmp_path / "thing.h5"
    Parts(artifact, KIND, KEY).write(0, _part(1.0))
    other = Parts(artifact, KIND, canonical_hash({"settings": 2}))
    assert not other.has(0)
    assert not Parts(artifact, KIND, KEY).has(0)


def test_a_damaged_part_is_discarded_and_made_again(tmp_path: Path) -> None:
    parts = Parts(tmp_path / "thing.h5", KIND, KEY)
    parts.write(0, _part(1.0))
    (path,) = parts.folder.iterdir()
    path.write_bytes(path.read_bytes()[:-50])
    assert not parts.has(0)
    assert not path.exists()
    parts.write(0, _part(1.0))
    assert parts.has(0)


def test_an_unfinished_part_counts_for_nothing(tmp_path: Path) -> None:
    parts = Parts(tmp_path / "thing.h5", KIND, KEY)
    parts.write(0, _part(1.0))
    (path,) = parts.folder.iterdir()
    path.rename(path.with_name(path.name + ".partial"))
    assert not Parts(tmp_path / "thing.h5", KIND, KEY).has(0)


def test_a_part_that_is_not_there_is_an_artifact_error(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="missing"):
        Parts(tmp_path / "thing.h5", KIND, KEY).read(0)

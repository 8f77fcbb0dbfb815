"""The file of a part: values come back, large rows as HDF5 itself filters them, and damage anywhere is found."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.part_file import read_part, read_start, write_part
from robid.errors import ArtifactError

KIND = Kind("thing", "1.0", "robid make-thing")
ROW = ("configuration", "sample", "channel")
# More than one chunk along two axes, none of which divides the size.
SAMPLES = np.random.default_rng(3).standard_normal((1, 3, 60001, 5))
PART = Artifact(
    KIND,
    {
        "samples": Dataset(SAMPLES, "N m", ("configuration", "period", "sample", "channel"), "Torque", compact=True),
        "clipped": Dataset(SAMPLES > 2, "1", ("configuration", "period", "sample", "channel")),
        "response": Dataset(SAMPLES[:, 0, :4000] * 1j, "rad/N", ROW),
        "few": Dataset(np.array([[1.0, np.nan, np.inf]]), "1", ("configuration", "channel")),
        "names": Dataset(np.array(["q1", "ß"]), "1", ("channel",)),
        "none": Dataset(np.zeros((0, 2)), "1", ("a", "b")),
        "single": Dataset(np.array(2.5), "s", ()),
    },
    {"period_s": 0.1, "names": ["a", "b"], "count": 3, "done": True},
    Provenance("make-thing"),
)


def test_a_part_comes_back_as_it_was(tmp_path: Path) -> None:
    write_part(tmp_path / "x.part", PART)
    found = read_part(tmp_path / "x.part", KIND).to_artifact()
    assert found.attributes == PART.attributes
    assert list(found.datasets) == sorted(
        PART.datasets, key=lambda name: (PART.datasets[name].axes[:1] == ROW[:1], name)
    )
    for name, dataset in PART.datasets.items():
        read = found.datasets[name]
        assert (read.units, read.axes, read.description) == (dataset.units, dataset.axes, dataset.description)
        atol = 1e-7 * np.abs(SAMPLES).max() if dataset.compact else 0
        if dataset.values.dtype.kind == "U":
            assert read.values.tolist() == dataset.values.tolist()
        else:
            np.testing.assert_allclose(read.values, dataset.values, rtol=0, atol=atol)
            assert read.values.shape == dataset.values.shape


@pytest.mark.parametrize("name", ["samples", "clipped"])
def test_chunks_are_those_that_hdf5_filters_itself(tmp_path: Path, name: str) -> None:
    write_part(tmp_path / "x.part", PART)
    part = read_part(tmp_path / "x.part", KIND)
    values, starts = part.values(name), list(part.starts(name))
    assert len(starts) > 1
    step = tuple(sorted({each[axis] for each in starts} | {values.shape[axis]})[1] for axis in range(values.ndim))
    # The last chunks are filled up.
    assert any(size % one for size, one in zip(values.shape, step, strict=True))
    with h5py.File(tmp_path / "x.h5", "w") as file:
        dataset = file.create_dataset("x", values.shape, values.dtype, chunks=step, compression=1, shuffle=True)
        for start, content in zip(starts, part.chunks[name], strict=True):
            dataset.id.write_direct_chunk(start, content)
    with h5py.File(tmp_path / "x.h5") as file:
        np.testing.assert_array_equal(file["x"][()], values)


def test_the_start_holds_what_has_no_rows(tmp_path: Path) -> None:
    write_part(tmp_path / "x.part", PART)
    start = read_start(tmp_path / "x.part", KIND)
    assert sorted(start.stored) == ["names", "none", "single"]
    assert start.labels == read_part(tmp_path / "x.part", KIND).labels


def test_any_flipped_byte_and_any_end_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "x.part"
    write_part(path, replace(PART, datasets={name: PART.datasets[name] for name in ("few", "names", "single")}))
    content = path.read_bytes()
    for place in range(0, len(content), 7):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        with pytest.raises(ArtifactError, match="A013"):
            read_part(path, KIND)
        path.write_bytes(content[:place])
        with pytest.raises(ArtifactError, match="A013"):
            read_part(path, KIND)
    for place in range(0, content.index(b"q1"), 7):
        path.write_bytes(content[:place])
        with pytest.raises(ArtifactError, match="A013"):
            read_start(path, KIND)


def test_another_kind_or_version_is_refused(tmp_path: Path) -> None:
    write_part(tmp_path / "x.part", PART)
    for kind, code in ((Kind("other", "1.0", ""), "A011"), (Kind("thing", "2.0", ""), "A012")):
        for read in (read_part, read_start):
            with pytest.raises(ArtifactError, match=code):
                read(tmp_path / "x.part", kind)

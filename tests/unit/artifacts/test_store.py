"""The store: round trips, damage, versions, kills, and what the content hash depends on."""

import math
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.atomic import replacing
from robid.artifacts.kinds import FRF, RECORD
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import inspect_artifact, read_artifact, read_header, write_artifact
from robid.errors import ArtifactError
from tolerances import COMPACT

KIND = Kind("thing", "1.2", "robid make-thing")
PROVENANCE = Provenance("make-thing", {"count": 3}, "abc", {"record": "def"}, 1, {"numpy": "2"}, "", "t0", "t1")
AXES = ("a", "b", "c", "d")

_text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8)
_dtypes = st.one_of(
    hnp.floating_dtypes(endianness="?", sizes=(32, 64)),
    hnp.complex_number_dtypes(endianness="?", sizes=(64, 128)),
    hnp.integer_dtypes(endianness="?"),
    hnp.boolean_dtypes(),
)
_arrays = hnp.arrays(_dtypes, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4))
_strings = st.lists(_text, max_size=4).map(lambda items: np.asarray(items, dtype=str))
_attributes = st.dictionaries(
    st.from_regex(r"[a-z_]{1,8}", fullmatch=True),
    st.one_of(
        st.booleans(),
        st.integers(-(2**63), 2**63 - 1),
        st.floats(allow_nan=False),
        _text,
        st.lists(st.booleans(), max_size=3),
        st.lists(st.floats(allow_nan=False), max_size=3),
        st.lists(_text, max_size=3),
    ),
    max_size=4,
)


def _thing(**changes: object) -> Artifact:
    datasets = {
        "response": Dataset(np.arange(40.0).reshape(4, 10) + 1j, "rad/N", ("configuration", "frequency")),
        "samples": Dataset(np.random.default_rng(1).standard_normal((3, 9000)), "N m", ("configuration", "sample")),
        "deep/names": Dataset(np.array(["q1", "ß"]), "1", ("joint",)),
    }
    return replace(Artifact(KIND, datasets, {"period_s": 0.1, "names": ["a", "b"]}, PROVENANCE), **changes)


def _same(left: Dataset, right: Dataset) -> bool:
    return (left.units, left.axes, left.description) == (right.units, right.axes, right.description) and (
        left.values.shape == right.values.shape and bool(np.array_equal(left.values, right.values))
    )


@given(array=st.one_of(_arrays, _strings), attributes=_attributes, description=_text)
def test_what_is_written_comes_back(tmp_path_factory, array, attributes, description) -> None:
    path = tmp_path_factory.mktemp("round") / "thing.h5"
    dataset = Dataset(array, "N m", AXES[: array.ndim], description)
    digest = write_artifact(path, Artifact(KIND, {"group/array": dataset}, attributes, PROVENANCE))
    found = read_artifact(path, KIND)
    values = found.datasets["group/array"].values
    np.testing.assert_array_equal(values, array, strict=False)
    assert values.shape == array.shape
    assert values.dtype.kind == array.dtype.kind
    assert values.dtype.itemsize == array.dtype.itemsize or array.dtype.kind == "U"
    assert (found.datasets["group/array"].units, found.datasets["group/array"].description) == ("N m", description)
    assert dict(found.attributes) == attributes
    assert {name: type(value) for name, value in found.attributes.items()} == {
        name: type(value) for name, value in attributes.items()
    }
    assert found.provenance == PROVENANCE
    assert read_header(path).content_sha256 == digest


@given(
    array=hnp.arrays(np.float64, st.integers(1, 20), elements=st.floats(-1e12, 1e12, allow_subnormal=False)),
    factor=st.sampled_from([1e-9, 1.0, 3e7]),
)
def test_compact_values_round_to_float32_of_the_largest_and_only_once(tmp_path_factory, array, factor) -> None:
    array = array * factor
    path = tmp_path_factory.mktemp("compact") / "thing.h5"
    first = Artifact(KIND, {"x": Dataset(array, "rad", ("sample",), compact=True)}, {}, PROVENANCE)
    digest = write_artifact(path, first)
    found = read_artifact(path, KIND)
    np.testing.assert_allclose(
        found.datasets["x"].values, array, rtol=0, atol=2 * COMPACT * np.max(np.abs(array), initial=0)
    )
    assert found.datasets["x"].values.dtype == np.float64
    assert write_artifact(path, found) == digest


def test_compact_values_joined_under_another_scale_do_not_change(tmp_path: Path) -> None:
    generator = np.random.default_rng(2)
    parts = [scale * generator.standard_normal((1, 500)) for scale in (1e-3, 7.0)]
    read = []
    for part in parts:
        write_artifact(tmp_path / "p.h5", _samples(part))
        read.append(read_artifact(tmp_path / "p.h5", KIND).datasets["x"].values)
    direct = write_artifact(tmp_path / "direct.h5", _samples(np.concatenate(parts)))
    through_parts = write_artifact(tmp_path / "parts.h5", _samples(np.concatenate(read)))
    assert direct == through_parts


def _samples(values: np.ndarray) -> Artifact:
    return Artifact(KIND, {"x": Dataset(values, "rad", ("configuration", "sample"), compact=True)}, {}, PROVENANCE)


def test_compact_values_keep_what_is_not_finite(tmp_path: Path) -> None:
    values = np.array([[np.nan, np.inf, 2.0]])
    write_artifact(tmp_path / "thing.h5", _samples(values))
    np.testing.assert_array_equal(read_artifact(tmp_path / "thing.h5", KIND).datasets["x"].values, values)


def test_what_is_left_out_is_not_read(tmp_path: Path) -> None:
    write_artifact(tmp_path / "a.h5", _thing())
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["samples"][1, 5] = 7.0  # damage where nobody looks
    found = read_artifact(tmp_path / "a.h5", KIND, row=1, leave_out=("samples",))
    assert sorted(found.datasets) == ["deep/names", "response"]
    with pytest.raises(ArtifactError, match="damaged"):
        read_artifact(tmp_path / "a.h5", KIND, row=1)


def test_the_hash_depends_on_content_only(tmp_path: Path) -> None:
    thing = _thing()
    digest = write_artifact(tmp_path / "a.h5", thing)
    other_provenance = replace(thing, provenance=Provenance("other", {"count": 4}))
    assert write_artifact(tmp_path / "b.h5", other_provenance) == digest
    assert read_header(tmp_path / "b.h5").provenance.stage == "other"
    reversed_order = replace(
        thing,
        datasets=dict(reversed(thing.datasets.items())),
        attributes=dict(reversed(thing.attributes.items())),
    )
    assert write_artifact(tmp_path / "c.h5", reversed_order) == digest
    assert write_artifact(tmp_path / "d.h5", read_artifact(tmp_path / "a.h5", KIND)) == digest


@pytest.mark.parametrize(
    "change",
    [
        lambda d: replace(d, values=d.values + 1e-15),
        lambda d: replace(d, values=d.values.T.copy(), axes=d.axes[::-1]),
        lambda d: replace(d, values=d.values.astype(np.complex64)),
        lambda d: replace(d, units="rad/A"),
        lambda d: replace(d, axes=("a", "b")),
    ],
)
def test_the_hash_tells_any_change_of_a_dataset(tmp_path: Path, change) -> None:
    thing = _thing()
    digest = write_artifact(tmp_path / "a.h5", thing)
    datasets = {**thing.datasets, "response": change(thing.datasets["response"])}
    assert write_artifact(tmp_path / "b.h5", replace(thing, datasets=datasets)) != digest


def test_the_hash_tells_a_changed_attribute_and_path(tmp_path: Path) -> None:
    thing = _thing()
    digests = {
        write_artifact(tmp_path / "a.h5", thing),
        write_artifact(tmp_path / "a.h5", replace(thing, attributes={**thing.attributes, "period_s": 0.2})),
        write_artifact(
            tmp_path / "a.h5", replace(thing, datasets={f"x/{path}": data for path, data in thing.datasets.items()})
        ),
    }
    assert len(digests) == 3


def _assert_refused(path: Path, *words: str) -> None:
    for read in (lambda: read_artifact(path, KIND), lambda: read_header(path, KIND)):
        with pytest.raises(ArtifactError) as caught:
            read()
        assert caught.value.where == str(path)
        assert "robid make-thing" in caught.value.remedy
        assert all(word in caught.value.what for word in words)


def test_a_missing_artifact_is_named_with_the_command_that_makes_it(tmp_path: Path) -> None:
    _assert_refused(tmp_path / "thing.h5", "missing")


@pytest.mark.parametrize("length", [0, 1, 100, 0.5, 0.99])
def test_a_truncated_artifact_is_refused(tmp_path: Path, length: float) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing())
    content = path.read_bytes()
    path.write_bytes(content[: length if isinstance(length, int) else int(len(content) * length)])
    _assert_refused(path, "is damaged")
    with pytest.raises(ArtifactError):
        inspect_artifact(path)


def test_a_flipped_byte_is_refused_or_harmless(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    thing = _thing()
    write_artifact(path, thing)
    content = path.read_bytes()
    positions = [*range(0, len(content), len(content) // 150), *range(0, 4000, 37)]
    refused = 0
    for position in positions:
        path.write_bytes(content[:position] + bytes([content[position] ^ 0x55]) + content[position + 1 :])
        try:
            found = read_artifact(path, KIND)
        except ArtifactError as error:
            assert error.where == str(path)  # noqa: PT017
            refused += 1
        else:
            assert all(_same(found.datasets[name], dataset) for name, dataset in thing.datasets.items())
            assert found.attributes == thing.attributes
    assert refused > len(positions) / 2


def test_a_changed_value_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing())
    with h5py.File(path, "r+") as file:
        file["response"][0, 0] = 99
    with pytest.raises(ArtifactError, match="does not match its hash"):
        read_artifact(path, KIND)


def test_what_is_changed_or_replaced_after_it_was_read_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing())
    first = read_header(path, KIND)
    read_artifact(path, KIND).datasets["deep/names"].values[0] = "another"
    assert read_artifact(path, KIND).datasets["deep/names"].values[0] == "q1", "each reader has arrays of its own"
    write_artifact(path, _thing(attributes={"period_s": 0.2}))
    assert read_header(path, KIND) != first
    assert read_artifact(path, KIND).attributes == {"period_s": 0.2}
    time.sleep(0.02)  # times of files go by ticks of some milliseconds
    with h5py.File(path, "r+") as file:
        file["attributes"].attrs["period_s"] = 0.3
    with pytest.raises(ArtifactError, match="does not match its hash"):
        read_artifact(path, KIND)


def test_a_file_that_is_no_artifact_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1
    _assert_refused(path, "is damaged")


def test_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing(kind=Kind("frf", "1.0", "robid estimate-frf")))
    _assert_refused(path, "`frf`", "`thing`")


@pytest.mark.parametrize("version", ["2.0", "0.9", "12.0", "later"])
def test_an_unknown_major_version_is_refused(tmp_path: Path, version: str) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing(kind=replace(KIND, version=version)))
    _assert_refused(path, version, "1.x")


def test_another_file_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    for change in (lambda attributes: attributes.pop("format"), lambda a: a.modify("format", np.bytes_("9"))):
        write_artifact(path, _thing())
        with h5py.File(path, "r+") as file:
            change(file.attrs)
        _assert_refused(path, "A010", "reads format 2")
        with pytest.raises(ArtifactError, match="A010"):
            inspect_artifact(path)


def test_another_minor_version_is_read(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing(kind=replace(KIND, version="1.7")))
    assert read_artifact(path, KIND).kind.version == "1.7"


_KILLED = """
import os, sys
from pathlib import Path
import numpy as np
from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.store import write_artifact
Path.replace = lambda *_: os._exit(9)
values = Dataset(np.zeros(5), "rad", ("a",))
write_artifact(Path(sys.argv[1]), Artifact(Kind("thing", "1.2", ""), {"x": values}, {}, Provenance("s")))
"""


def test_a_kill_before_the_rename_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    digest = write_artifact(path, _thing())
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", _KILLED, str(path)], check=False, env=environment)
    assert done.returncode == 9
    assert {file.name for file in tmp_path.iterdir()} == {"thing.h5", "thing.h5.partial"}
    assert read_artifact(path, KIND).datasets.keys() == _thing().datasets.keys()
    assert read_header(path).content_sha256 == digest
    write_artifact(path, _thing(attributes={}))
    assert [file.name for file in tmp_path.iterdir()] == ["thing.h5"]
    assert read_artifact(path, KIND).attributes == {}


def test_a_write_that_fails_says_so_and_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing())
    (tmp_path / "thing.h5.partial").mkdir()
    with pytest.raises(ArtifactError, match="cannot be written") as caught:
        write_artifact(path, _thing(attributes={}))
    assert caught.value.where == str(path)
    assert read_artifact(path, KIND).attributes == _thing().attributes


def test_two_writers_of_one_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    path = tmp_path / "part.h5"
    with replacing(path, alone=False) as first, replacing(path, alone=False) as second:
        first.write_text("one")
        second.write_text("two")
    assert path.read_text() == "one"  # the outer one is done last
    assert [file.name for file in tmp_path.iterdir()] == ["part.h5"]


def test_inspect_describes_without_values(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    digest = write_artifact(path, _thing())
    found = inspect_artifact(path)
    assert (found.kind, found.schema_version, found.content_sha256) == ("thing", "1.2", digest)
    assert found.attributes == {"period_s": 0.1, "names": ["a", "b"]}
    assert found.provenance.settings == {"count": 3}
    row = found.datasets["response"]
    assert row.shape == (4, 10)
    assert row.dtype == "complex128"
    assert (row.units, row.axes) == ("rad/N", ("configuration", "frequency"))
    assert found.datasets["deep/names"].dtype == "str"


def test_large_arrays_are_compressed_in_chunks_along_the_first_axis(tmp_path: Path) -> None:
    values = np.zeros((5, 20000))
    write_artifact(tmp_path / "thing.h5", _samples(values))
    with h5py.File(tmp_path / "thing.h5") as file:
        assert file["x"].chunks == (1, 20000)
        assert (file["x"].compression, file["x"].shuffle) == ("gzip", True)
        assert math.prod(file["x"].shape) * 4 > 10 * file["x"].id.get_storage_size()


def test_long_vectors_have_few_chunks(tmp_path: Path) -> None:
    write_artifact(tmp_path / "thing.h5", _thing(datasets={"x": Dataset(np.zeros(100_000, int), "1", ("line",))}))
    with h5py.File(tmp_path / "thing.h5") as file:
        assert 100_000 // file["x"].chunks[0] < 20


def test_noise_of_full_precision_is_stored_as_it_is(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).standard_normal(100_000)
    write_artifact(tmp_path / "thing.h5", _thing(datasets={"x": Dataset(noise, "1", ("line",))}))
    with h5py.File(tmp_path / "thing.h5") as file:
        assert file["x"].compression is None


@pytest.mark.parametrize("value", [None, [1, "a"], [[1]], {"a": 1}, object()])
def test_an_attribute_that_is_no_scalar_or_list_is_a_defect(tmp_path: Path, value: object) -> None:
    with pytest.raises(ValueError, match="Attribute `odd`"):
        write_artifact(tmp_path / "thing.h5", _thing(attributes={"odd": value}))
    assert not list(tmp_path.iterdir())


def test_axes_must_name_every_axis() -> None:
    with pytest.raises(ValueError, match="do not name"):
        Dataset(np.zeros((2, 3)), "rad", ("configuration",))
    with pytest.raises(ValueError, match="type object"):
        Dataset(np.array([None]), "rad", ("configuration",))


_DISK_FULL = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from robid.artifacts.artifact import Artifact, Dataset, Kind, Provenance
from robid.artifacts.store import write_artifact
from robid.artifacts.results import VALIDATION
from robid.errors import ArtifactError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, resource.RLIM_INFINITY))
values = Dataset(np.random.default_rng(1).standard_normal((4, 20_000)), "rad", ("a", "b"))
try:
    write_artifact(Path(sys.argv[1]), Artifact(Kind("thing", "1.2", ""), {"x": values}, {}, Provenance("s")))
except ArtifactError as error:
    sys.exit(error.what)
"""


def test_a_full_disk_is_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "thing.h5"
    digest = write_artifact(path, _thing(datasets={}))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", _DISK_FULL, str(path)]
    done = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
    assert done.stderr == "A001 The file cannot be written: File too large.\n"
    assert [file.name for file in tmp_path.iterdir()] == ["thing.h5"]
    assert read_header(path, KIND).content_sha256 == digest


def test_provenance_may_be_long(tmp_path: Path) -> None:
    provenance = replace(PROVENANCE, settings={str(index): "größer" * 10 for index in range(5000)})
    write_artifact(tmp_path / "thing.h5", _thing(provenance=provenance))
    assert read_header(tmp_path / "thing.h5", KIND).provenance == provenance


def test_inspecting_a_file_of_another_format_does_not_advise_to_delete_it(tmp_path: Path) -> None:
    path = tmp_path / "experiment.yaml"
    path.write_text("name: arm\n")
    with pytest.raises(ArtifactError, match="A009") as caught:
        inspect_artifact(path)
    assert "delete" not in caught.value.remedy


@pytest.mark.parametrize(
    ("kind", "version"), [(RECORD, "1.3"), (FRF, "1.4"), (MODEL, "1.5"), (VALIDATION, "1.0"), (VALIDATION, "2.0")]
)
def test_files_of_an_earlier_schema_are_refused_with_what_to_do(tmp_path: Path, kind: Kind, version: str) -> None:
    path = tmp_path / "thing.h5"
    write_artifact(path, _thing(kind=replace(kind, version=version)))
    with pytest.raises(ArtifactError, match=f"schema version {version}") as caught:
        read_artifact(path, kind)
    assert f"{kind.version.partition('.')[0]}.x" in str(caught.value)
    assert f"make it again with `{kind.made_by} EXPERIMENT.yaml --force`" in str(caught.value.remedy)

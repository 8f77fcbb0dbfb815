"""What client and workers share beside the scheduler."""

from pathlib import Path

import numpy as np
import pytest

import backend_tasks
from robid.backends.dask.exchange import PREFIX, Exchange, shared_folder, unpack
from robid.errors import ArtifactError


def arrays(exchange: Exchange) -> list[Path]:
    return sorted(exchange.folder.glob("*.npy"))


def test_a_large_array_that_tasks_share_is_one_file_for_as_long_as_one_needs_it(tmp_path: Path) -> None:
    shared = np.arange(50_000.0)
    with shared_folder(tmp_path) as exchange:
        packer = exchange.packer()
        packed = [packer.pack(backend_tasks.sum_and_spoil, (shared, factor)) for factor in (1, 2)]
        assert all(len(each) < 1000 for each, _ in packed)
        assert len(arrays(exchange)) == 1
        function, (values, factor) = unpack(packed[1][0], str(exchange.folder))
        assert function is backend_tasks.sum_and_spoil
        assert factor == 2
        np.testing.assert_array_equal(values, shared)
        assert values.flags.writeable
        exchange.release(packed[0][1])
        assert len(arrays(exchange)) == 1
        exchange.release(packed[1][1])
        assert arrays(exchange) == []
        again, _ = packer.pack(backend_tasks.sum_and_spoil, (shared, 3))
        np.testing.assert_array_equal(unpack(again, str(exchange.folder))[1][0], shared)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "values",
    [
        np.asfortranarray(np.arange(40_000.0).reshape(200, 200)),
        np.arange(80_000.0).reshape(200, 400)[:, ::2],
        np.arange(20_000) * (1 + 2j),
        np.array(["torque", "angle"] * 5000),
    ],
    ids=["fortran", "strided", "complex", "text"],
)
def test_arrays_come_back_as_pickle_brings_them_back(tmp_path: Path, values: np.ndarray) -> None:
    assert values.nbytes > 2**16
    with shared_folder(tmp_path) as exchange:
        packed, names = exchange.packer().pack(backend_tasks.describe, values)
        assert len(names) == 1
        found = backend_tasks.describe(unpack(packed, str(exchange.folder))[1])
    assert found == backend_tasks.describe(values.copy(order="K") if values.flags.fnc else values.copy())


def test_other_arrays_of_the_same_bytes_have_other_names(tmp_path: Path) -> None:
    values = np.arange(40_000.0).reshape(200, 200)
    alike = [values, values.reshape(400, 100), values.view(np.int64), np.asfortranarray(values), values.T]
    with shared_folder(tmp_path) as exchange:
        names = [exchange.keep(each) for each in alike]
    assert len(set(names)) == 5


def test_small_arrays_and_objects_travel_along(tmp_path: Path) -> None:
    with shared_folder(tmp_path) as exchange:
        task = (np.arange(10), np.array([object] * 20_000), "text")
        packed, names = exchange.packer().pack(len, task)
        assert not names
        assert unpack(packed, str(exchange.folder))[1][2] == "text"


def test_what_a_killed_client_left_is_removed_and_what_a_living_one_has_stays(tmp_path: Path) -> None:
    left = tmp_path / f"{PREFIX}0123"
    left.mkdir()
    for name in ("lock", "token", "old.npy"):
        (left / name).touch()
    with shared_folder(tmp_path) as first, shared_folder(tmp_path) as second:
        assert {path.name for path in tmp_path.iterdir()} == {first.folder.name, second.folder.name}
        assert first.token != second.token
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ArtifactError, match="cannot be written") as caught, shared_folder(tmp_path / "file" / "run"):
        pass
    assert str(tmp_path / "file") in caught.value.where


def test_an_array_that_does_not_fit_on_the_disk_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    with shared_folder(tmp_path) as exchange:
        monkeypatch.setattr(np, "save", full)
        with pytest.raises(ArtifactError, match="No space left"):
            exchange.packer().pack(len, np.zeros(50_000))
        assert arrays(exchange) == []

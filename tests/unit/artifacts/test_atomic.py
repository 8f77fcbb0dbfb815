"""JSON files: plain values, replaced at once, refused by name."""

from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.atomic import read_json, replacing, write_json
from robid.errors import ArtifactError


def test_numpy_values_become_plain_and_what_is_not_finite_null(tmp_path: Path) -> None:
    path = tmp_path / "new" / "truth.json"
    write_json(path, {"a": np.float64(0.1), "b": np.arange(2), 3: (np.nan, np.inf, True), "ü": [np.bool_(0), None]})
    assert read_json(path) == {"a": 0.1, "b": [0, 1], "3": [None, None, True], "ü": [False, None]}


def test_a_missing_or_damaged_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    with pytest.raises(ArtifactError, match="missing"):
        read_json(path)
    for content in (b'{"a": 1', b"\xff\xfe"):
        path.write_bytes(content)
        with pytest.raises(ArtifactError, match="damaged") as caught:
            read_json(path, made_by="robid simulate-or-acquire")
        assert caught.value.where == str(path)
        assert "robid simulate-or-acquire" in caught.value.remedy


def test_a_value_json_cannot_hold_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert read_json(path) == {"a": 1}


def test_an_interrupt_while_writing_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    write_json(path, {"a": 1})

    def interrupted() -> None:
        with replacing(path) as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["truth.json"]
    assert read_json(path) == {"a": 1}

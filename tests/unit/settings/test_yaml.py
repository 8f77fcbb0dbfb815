from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.settings.yaml import Document, load_yaml


def _load(folder: Path, text: str) -> Document:
    path = folder / "file.yaml"
    path.write_text(text, encoding="utf-8")
    return load_yaml(path)


def test_scalars_are_plain_python_values(tmp_path):
    document = _load(
        tmp_path, "a: 1e-6\nb: 1E5\nc: 3\nd: &x true\ne: 'text'\nf: >-\n  two\n  lines\ng:\nh: 2020-01-02\n"
    )
    assert document.data == {
        "a": 1e-6, "b": 1e5, "c": 3, "d": True, "e": "text", "f": "two lines", "g": None, "h": "2020-01-02"
    }  # fmt: skip
    assert [type(value) for value in document.data.values()] == [float, float, int, bool, str, str, type(None), str]


def test_lines_of_keys_items_and_nearest_parents(tmp_path):
    document = _load(tmp_path, "# comment\na:\n  b: 1\n  c:\n    - 10\n    - {d: 2,\n       e: 3}\nf: 4\n")
    assert document.line(("a",)) == 2
    assert document.line(("a", "b")) == 3
    assert document.line(("a", "c", 0)) == 5
    assert document.line(("a", "c", 1, "e")) == 7
    assert document.line(("f",)) == 8
    assert document.line(("a", "missing", "deeper")) == 2
    assert document.line(("a", "c", 7)) == 4


def test_merge_keys_give_values_and_the_line_they_are_written_on(tmp_path):
    text = "a: &x {seed: 1, count: 2}\nb: &y\n  rms: 3\nc:\n  <<: [*x, *y]\n  seed: 9\nd: *x\ne:\n  <<: *x\n"
    document = _load(tmp_path, text)
    assert document.data["c"] == {"seed": 9, "count": 2, "rms": 3}
    assert document.data["d"] == {"seed": 1, "count": 2}
    assert document.line(("c", "seed")) == 6
    assert document.line(("c", "count")) == 1
    assert document.line(("c", "rms")) == 3
    assert document.line(("e", "seed")) == 1


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("a: 1\nb: 2\na: 3\n", 3, 'duplicate key "a"'),
        ("a: 1\nb: [1,\nc: 2\n", 4, "flow sequence (line 2): expected"),
        ("a: 1\nb: *nowhere\n", 2, "undefined alias"),
        ("a: 1\n---\nb: 2\n", 2, "single document"),
        ("a:\n\t- 1\n", 2, "cannot start any token"),
        ("a: 1\nb: !python 2\n", 2, "tags"),
        ("a: 1\nb: [1, !foo [0]]\n", 2, "tags"),
        ("a: 1\nb: !foo {c: 0}\n", 2, "tags"),
        ("a: 2026-01-02\nb:\n  - 2026-13-45\n", 3, "S524"),
        ("a: 1\n2: 2\n", 2, "S339"),
        ("a: {b: 8,6e-05}\n", 1, "S339"),
        ("a: &x\n  b: 1\n  c: *x\n", 1, "S337"),
        ("a: &x\n  <<: *x\n", 1, "S337"),
        ("- 1\n", 1, "S336"),
        ("", 1, "is empty"),
    ],
)
def test_bad_yaml_names_file_and_line(tmp_path, text, line, words):
    with pytest.raises(SettingsError) as caught:
        _load(tmp_path, text)
    assert caught.value.where == f"{tmp_path / 'file.yaml'}:{line}"
    assert words in caught.value.what
    assert caught.value.remedy


def test_a_decimal_comma_is_named(tmp_path):
    with pytest.raises(SettingsError) as caught:
        _load(tmp_path, "a: {b: 8,6e-05}\n")
    assert "decimal point" in caught.value.remedy


def test_unreadable_files_are_settings_errors(tmp_path):
    with pytest.raises(SettingsError, match="No such file"):
        load_yaml(tmp_path / "absent.yaml")
    with pytest.raises(SettingsError, match="is a folder"):
        load_yaml(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(SettingsError, match="UTF-8"):
        load_yaml(tmp_path / "binary.yaml")
    (tmp_path / "control.yaml").write_bytes(b"a: \x01")
    with pytest.raises(SettingsError, match="S338"):
        load_yaml(tmp_path / "control.yaml")

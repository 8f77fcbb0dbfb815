"""Nothing that a settings file says makes reading it long, large or endless; each case within a second or two."""

import os
import resource
import time
from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.settings.bounded_yaml import DEEPEST, MOST_BYTES, MOST_NODES
from robid.settings.yaml import load_yaml

_SECONDS = 5.0  # on a machine that does other work too; what this guards against takes minutes, or never ends


def _aliases(of: str) -> str:
    """Sections of which each repeats the one before it; the last one stands for 9**30 values or more."""
    lines = [of.format(above=f"*a{number - 1}", own=f"a{number}: &a{number}") for number in range(1, 31)]
    return "a0: &a0 {x: 1}\n" + "".join(lines)


_LISTS = "{own} [" + ", ".join(["{above}"] * 9) + "]\n"
_SECTIONS = "{own} {{p: {above}, q: {above}}}\n"
_MERGES = "{own} {{<<: [{above}, {above}], r: 1}}\n"


def _read(folder, text: str):
    path = folder / "file.yaml"
    path.write_text(text, encoding="utf-8")
    begun = time.monotonic()
    try:
        return load_yaml(path).data
    finally:
        assert time.monotonic() - begun < _SECONDS


@pytest.mark.parametrize(
    ("text", "line", "code"),
    [
        pytest.param(_aliases(_LISTS), None, "S592", id="lists of aliases"),
        pytest.param(_aliases(_SECTIONS), None, "S592", id="sections of aliases"),
        pytest.param(_aliases(_MERGES), None, "S592", id="merged sections"),
        pytest.param("a: &x 1\nb: [" + "*x, " * (MOST_NODES + 1) + "]\n", 2, "S592", id="aliases of a number"),
        pytest.param("a: [" + "1, " * (MOST_NODES + 1) + "]\n", 1, "S592", id="many values"),
        pytest.param("a: 1\nb: " + "[" * 500 + "]" * 500, 2, "S592", id="500 levels of lists"),
        pytest.param("a: " + "{" * 100_000, 1, "S592", id="sections without end"),
        pytest.param("".join(" " * depth + "a:\n" for depth in range(500)), DEEPEST, "S592", id="500 levels by lines"),
        pytest.param("a: 1\nb: !foo {c: 0}\n", 2, "S340", id="tagged section"),
        pytest.param("a: 1\nb: !foo [0]\n", 2, "S340", id="tagged list"),
        pytest.param("a: 1\nb: ! x\n", 2, "S340", id="tag without a name"),
        pytest.param("a: 1\nb: !!int x\n", 2, "S340", id="no number"),
        pytest.param('a: 1\nb: !!int "3"\n', 2, "S340", id="tagged number"),
        pytest.param("a: 1\nb: !!omap [c: 1]\n", 2, "S340", id="ordered map"),
        pytest.param("a: !!python/object/apply:os.system [ls]\n", 1, "S340", id="call"),
        pytest.param("a: 1\nb: 2026-13-45\n", 2, "S524", id="month 13"),
        pytest.param("a: 1\nb: 2001-12-14t21:59:43.10-99:00\n", 2, "S524", id="zone of 99 hours"),
        pytest.param("a: 1\nb: " + "1" * 5_000, 2, "S591", id="5,000 digits"),
        pytest.param("a: 1\nb: " + "1" * 1_000_000, 2, "S591", id="a million digits"),
        pytest.param("a: 1\nb: 0x" + "f" * 6_000, 2, "S591", id="6,000 hexadecimal digits"),
        pytest.param("a: 1\nb: 99999999999999999999\n", 2, "S591", id="beyond 64 bits"),
        pytest.param("a: 1\nb: -_\n", 2, "S594", id="digits without digits"),
        pytest.param("a: 1\n? [b, c]\n: 1\n", 2, "S589", id="list as a key"),
        pytest.param("a: 1\n{b: c}: 1\n", 2, "S589", id="section as a key"),
        pytest.param("a: 1\n" + "k" * 1_000 + ": 1\n", 2, "S589", id="long key"),
        pytest.param('a: 1\nb: "x\\0"\n', 2, "S590", id="NUL"),
        pytest.param('a: 1\n"x\\0": 1\n', 2, "S590", id="NUL in a key"),
        pytest.param('a: 1\nb: ["\\ud800"]\n', 2, "S590", id="surrogate"),
        pytest.param('a: 1\nb: "\\e[2J"\n', 2, "S590", id="escape of a terminal"),
    ],
)
def test_attacks_are_refused_at_once_with_their_line(tmp_path, text, line, code):
    with pytest.raises(SettingsError) as caught:
        _read(tmp_path, text)
    place, _, found = caught.value.where.rpartition(":")
    assert place == str(tmp_path / "file.yaml")
    assert code in caught.value.what
    assert line is None or int(found) == line


def test_what_is_within_the_limits_is_read(tmp_path):
    text = (
        "a: 1\n# " + "x" * 1_000_000 + "\nb: " + "[" * (DEEPEST - 2) + "]" * (DEEPEST - 2) + "\nc: 123456789012345678\n"
    )
    data = _read(tmp_path, text)
    assert data["a"] == 1
    assert data["c"] == 123456789012345678
    rows = "".join("    - [1.5, 2.5, 3.5, 4.5, 5.5, 6.5]\n" for _ in range(2_000))
    assert len(_read(tmp_path, f"a:\n{rows}")["a"]) == 2_000
    twice = _read(tmp_path, "a: &x 1\nb: *x\nc: &x 2\nd: *x\n")
    assert twice == {"a": 1, "b": 1, "c": 2, "d": 2}


def test_reading_takes_a_time_that_grows_as_the_comment_does(tmp_path):
    def seconds(size: int) -> float:
        begun = time.process_time()
        _read(tmp_path, "a: 1\n# " + "x" * size + "\n")
        return time.process_time() - begun

    short = min(seconds(100_000) for _ in range(3))
    assert min(seconds(1_000_000) for _ in range(3)) < 30 * short


def test_the_memory_of_a_bomb_is_small(tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for of in (_LISTS, _SECTIONS, _MERGES):
        with pytest.raises(SettingsError):
            _read(tmp_path, _aliases(of))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


@pytest.mark.parametrize("content", [b"a: \xff", "a: 1".encode("utf-16"), b"\x80\x81", "a: 1".encode("utf-32")])
def test_other_encodings_are_refused(tmp_path, content):
    (tmp_path / "file.yaml").write_bytes(content)
    with pytest.raises(SettingsError) as caught:
        load_yaml(tmp_path / "file.yaml")
    assert any(code in caught.value.what for code in ("S334", "S548"))


def test_a_mark_of_the_encoding_is_no_part_of_the_first_key(tmp_path):
    (tmp_path / "file.yaml").write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert load_yaml(tmp_path / "file.yaml").data == {"a": 1}


def test_pipes_devices_and_large_files_are_no_settings(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    large = tmp_path / "large.yaml"
    large.write_bytes(b"#" * (MOST_BYTES + 1))
    for path in (tmp_path / "pipe.yaml", large, Path("/dev/zero"), Path("/dev/tty")):
        with pytest.raises(SettingsError, match="S333"):
            load_yaml(path)

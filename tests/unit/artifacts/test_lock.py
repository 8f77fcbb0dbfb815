"""A lock names its holder, and is free as soon as the holder is dead."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robid.artifacts.atomic import locked, remove_leftovers
from robid.errors import ArtifactError

HOLD = """
import sys
from pathlib import Path
from robid.artifacts.atomic import locked
with locked(Path(sys.argv[1]), "robid run other.yaml"):
    print("held", flush=True)
    sys.stdin.read()
"""


def holder(path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": environment}
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], **pipes)
    assert process.stdout.readline() == "held\n"
    return process


def test_a_lock_names_the_other_process_and_ends_with_it(tmp_path):
    path = tmp_path / "run" / ".lock"
    with holder(path) as process:
        with (
            pytest.raises(ArtifactError, match=f"process {process.pid}, since 20.*robid run other.yaml"),
            locked(path, ""),
        ):
            pass
        process.send_signal(signal.SIGKILL)
    assert json.loads(path.read_text())["pid"] == process.pid
    with locked(path, "mine"):
        assert json.loads(path.read_text())["pid"] == os.getpid()
    assert not path.exists()


def test_a_lock_is_given_back_after_an_error(tmp_path):
    path = tmp_path / ".lock"
    with pytest.raises(KeyboardInterrupt), locked(path, "mine"):
        raise KeyboardInterrupt
    with locked(path, "mine"):
        pass


@pytest.mark.parametrize("text", ["", "no JSON", json.dumps({"pid": 1, "since_utc": "then", "does": "init"})])
def test_what_a_stale_lock_says_does_not_matter(tmp_path, text):
    path = tmp_path / ".lock"
    path.write_text(text)
    with locked(path, "mine"):
        assert json.loads(path.read_text())["does"] == "mine"


def test_a_lock_that_says_nothing_is_still_one(tmp_path):
    path = tmp_path / ".lock"
    with locked(path, "mine"):
        path.write_text("")
        with pytest.raises(ArtifactError, match="says not which"), locked(path, "again"):
            pass


def test_what_nobody_resumes_is_removed_and_the_rest_stays(tmp_path):
    part = f"00000.{'0' * 16}.part"
    paths = {
        "a/record.h5.parts": [part, f"{part}.partial", f"{part}.0123abcd.partial"],
        "gone/record.h5.parts": [part, f"{part}.partial", f"{part}.0123abcd.partial"],
        "b/record.h5.parts": [part, "notes.txt"],
        "fits/f": ["model.h5.partial", "x.txt.partial"],
        ".": ["report.html.partial", "mine.partial"],
        "a/b/c/d": ["far.h5.partial"],
    }
    for folder, names in paths.items():
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        for name in names:
            (tmp_path / folder / name).write_text("")
    remove_leftovers(tmp_path, {tmp_path / "a" / "record.h5"})
    left = {str(path.relative_to(tmp_path)) for path in Path(tmp_path).rglob("*") if path.is_file()}
    assert left == {
        f"a/record.h5.parts/{part}",
        "b/record.h5.parts/notes.txt",
        "fits/f/x.txt.partial",
        "mine.partial",
        "a/b/c/d/far.h5.partial",
    }
    assert not (tmp_path / "gone" / "record.h5.parts").exists()

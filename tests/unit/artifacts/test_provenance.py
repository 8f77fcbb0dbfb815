"""What provenance is made of."""

import subprocess
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robid
from robid.artifacts import artifact as provenance

_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.text(max_size=4), _values, min_size=2, max_size=4))
def test_the_hash_of_settings_ignores_the_order_of_keys(settings) -> None:
    assert provenance.canonical_hash(settings) == provenance.canonical_hash(dict(reversed(settings.items())))


def test_the_hash_of_settings_tells_values_and_nesting_apart() -> None:
    settings = [{"a": 1}, {"a": 2}, {"a": [1]}, {"a": "1"}, {"a": True}, {"a": 1.5}, {"b": 1}, {"a": {"a": 1}}, {}]
    assert len({provenance.canonical_hash(value) for value in settings}) == len(settings)


def test_versions_name_what_decides_the_numbers() -> None:
    versions = provenance.package_versions()
    assert versions["robid"] == robid.__version__
    assert {"python", "numpy", "scipy", "mujoco-core", "nlopt", "h5py"} <= set(versions)
    assert "not installed" not in versions.values()


def test_the_time_is_utc() -> None:
    assert datetime.fromisoformat(provenance.utc_now()).utcoffset() == timedelta(0)


def test_the_commit_is_that_of_the_source_tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "robid" / "__init__.py"
    package.parent.mkdir()
    package.write_text("")
    monkeypatch.setattr(provenance, "__file__", str(package.parent / "artifacts" / "artifact.py"))
    assert provenance.git_commit() == ""

    def git(*arguments: str) -> str:
        identity = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
        command = ["git", "-C", str(tmp_path), *identity, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    git("init", "--quiet")
    assert provenance.git_commit() == ""
    git("add", ".")
    git("commit", "--quiet", "-m", "first")
    assert provenance.git_commit() == git("rev-parse", "HEAD")
    package.write_text("changed = True\n")
    assert provenance.git_commit() == git("rev-parse", "HEAD") + "+"

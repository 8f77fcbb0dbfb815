"""Runs the command line on copies of inputs that once went wrong, kept beside the measured data."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from answers import Answer, ask

_ROOT = Path(__file__).parent.parent.parent


@dataclass(frozen=True)
class Case:
    """A copy of a case's folder, which is the current directory."""

    folder: Path

    def robid(self, *arguments: str) -> Answer:
        return ask(*arguments)


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Case]:
    """Copies a case into a folder of its own; skips the test where there are no cases."""

    def find(name: str) -> Case:
        data = Path(os.environ.get("ROBID_DATA", _ROOT / ".." / "shared" / "data"))
        folder = data.parent / "cases" / name
        if not folder.is_dir():
            pytest.skip(
                f"there is no folder {folder}; set ROBID_DATA to the data folder that has cases/{name} beside it"
            )
        for source in folder.rglob("*"):
            target = tmp_path / source.relative_to(folder)
            if source.is_file():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, target)
        monkeypatch.chdir(tmp_path)
        return Case(tmp_path)

    return find

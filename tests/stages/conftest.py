"""Runs the command line in a folder of its own, on experiments that take a second."""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path

import pytest

from answers import Answer, ask
from robid.artifacts.store import read_header

_HERE = Path(__file__).parent


class Workshop:
    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.experiment, self.runs = folder, "small.yaml", folder / "runs" / "small"
        shutil.copy(_HERE / "arm.yaml", folder)
        shutil.copy(_HERE / "small.yaml", folder)
        monkeypatch.chdir(folder)

    def robid(self, *arguments: str) -> Answer:
        return ask(*arguments)

    def refuse(self, code: int, *texts: str, command: tuple[str, ...] = ("run", "small.yaml")) -> Answer:
        """Runs a command that must fail, with one message and nothing changed."""
        before = self.files()
        answer = self.robid(*command)
        assert answer.code == code, answer.err
        assert len(re.findall(r"^robid: ", answer.err, re.MULTILINE)) == 1
        assert "Traceback" not in answer.err
        assert answer.out == ""
        for text in ("remedy: ", *texts):
            assert text in answer.flat
        assert self.files() == before
        return answer

    def change(self, old: str, new: str, file: str = "small.yaml") -> None:
        text = (self.folder / file).read_text()
        assert old in text
        (self.folder / file).write_text(text.replace(old, new, 1))

    def states(self) -> dict[str, tuple[str, str]]:
        nodes = self.robid("status", self.experiment, "--json").json["nodes"]
        return {node["output"]: (node["status"], node["why"]) for node in nodes}

    def contents(self, folder: Path | None = None) -> dict[str, str]:
        root = folder or self.runs
        return {str(path.relative_to(root)): read_header(path).content_sha256 for path in sorted(root.rglob("*.h5"))}

    def files(self) -> dict[str, str]:
        paths = [path for path in sorted(self.runs.rglob("*")) if path.is_file()]
        return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@pytest.fixture
def shop(tmp_path, monkeypatch):
    """A folder with the small experiment, not run yet."""
    return Workshop(tmp_path, monkeypatch)


@pytest.fixture(scope="session")
def design_shop():
    """Makes a folder with the experiment of designs, not run yet."""

    def make(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Workshop:
        shop = Workshop(folder, monkeypatch)
        shop.experiment, shop.runs = "design.yaml", folder / "runs" / "design"
        shutil.copy(_HERE / "design.yaml", folder)
        return shop

    return make


@pytest.fixture(scope="session")
def finished_runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as monkeypatch:
        answer = Workshop(folder, monkeypatch).robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    return folder / "runs"


@pytest.fixture
def done(shop, finished_runs):
    """A folder with the small experiment and its finished run."""
    shutil.copytree(finished_runs, shop.folder / "runs")
    return shop


@pytest.fixture(scope="session")
def workshop() -> type[Workshop]:
    """The kind of folder, for tests that share one."""
    return Workshop

"""What all tests share: deterministic hypothesis, and data folders that may not be there."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile("deterministic", derandomize=True, deadline=None, max_examples=40, database=None)
hypothesis.settings.load_profile("deterministic")

_ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def data_folder() -> Callable[[str], Path]:
    """Finds a folder of measured data by name; skips the test where it is not."""

    def find(name: str) -> Path:
        folder = Path(os.environ.get("ROBID_DATA", _ROOT / ".." / "shared" / "data")) / name
        if not folder.is_dir():
            pytest.skip(f"there is no data folder {folder}; set ROBID_DATA to the folder that holds {name}")
        return folder

    return find


def pytest_configure() -> None:
    """A shell that starts the tests in the background makes them deaf to interrupts, which some of them send."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)

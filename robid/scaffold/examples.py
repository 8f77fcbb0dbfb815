"""The examples that travel with the package, and where they lie."""

from __future__ import annotations

import re
from pathlib import Path

from robid.errors import SettingsError
from robid.settings.yaml import parse_yaml, read_text

EXAMPLES = {"kr300": "kr300.yaml", "rail": "kr300_rail.yaml", "drive": "drive.yaml"}
"""Experiment files by what `robid init --example` calls them."""


def examples_folder() -> Path:
    """Returns the folder of the examples: in the package, or `configs` of the checkout that it is used from.

    Raises:
        SettingsError: If there is neither.
    """
    built = Path(__file__).parent / "examples"
    checkout = Path(__file__).parents[2] / "configs"
    for folder in (built, checkout):
        if all((folder / name).is_file() for name in EXAMPLES.values()):
            return folder
    what = "S550 the examples are not there: the installation is not complete"
    raise SettingsError(what, where=str(built), remedy="install robid again: `pip install --force-reinstall robid`")


def example_files(example: str, name: str) -> dict[str, str]:
    """Returns the files of an example, an experiment of this name and its robot, by the names they shall have."""
    source = examples_folder() / EXAMPLES[example]
    text = read_text(source)
    robot = str(parse_yaml(source, text).data["robot"])
    experiment = _set(_set(text, "name", name), "robot", f"{name}_robot.yaml")
    return {f"{name}.yaml": experiment, f"{name}_robot.yaml": read_text(source.parent / robot)}


def _set(text: str, key: str, value: str) -> str:
    """Replaces a value at the top of a file, and leaves its comments."""
    return re.sub(rf"^{key}: \S+", f"{key}: {value}", text, count=1, flags=re.MULTILINE)

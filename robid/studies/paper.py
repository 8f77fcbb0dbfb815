"""The figures of the paper that a study redraws."""

from __future__ import annotations

from typing import Any

from robid.settings.load import LoadedExperiment
from robid.settings.yaml import load_yaml


def paper_figures(name: str | None, loaded: LoadedExperiment) -> dict[str, Any]:
    """Returns the paper's figures, or nothing where a study names no file.

    Args:
        name: The file, relative to the experiment's.
        loaded: The experiment.

    Raises:
        SettingsError: If the file cannot be read.
    """
    return {} if name is None else load_yaml(loaded.path.parent / name).data

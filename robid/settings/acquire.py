"""Models of measured logs in the experiment file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydantic.dataclasses
from pydantic import Field

from robid.settings.base import DATA_VARIABLE, STRICT, data_path
from robid.signals.log_channels import LogOptions


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class Acquire(LogOptions):
    """Measured logs and what their variables mean."""

    file: str = Field(
        description="The log; `${ROBID_DATA}` stands for the data folder, other paths start at the experiment file;"
        " `{configuration}`, `{realization}` and `{experiment}` for their numbers, from 1."
    )

    def log_path(self, folder: Path, configuration: int = 0, realization: int = 0, experiment: int = 0) -> Path:
        """Returns the path of a log.

        Args:
            folder: Folder of the experiment file, for a path that does not start with `${ROBID_DATA}`.
            configuration: Index of the configuration, from 0.
            realization: Index of the realization, from 0.
            experiment: Index of the experiment, from 0.
        """
        indices = {"configuration": configuration, "realization": realization, "experiment": experiment}
        rest = self.file.removeprefix(DATA_VARIABLE)
        start = self.file.removesuffix(rest) if rest else self.file
        return data_path(start + rest.format(**{key: index + 1 for key, index in indices.items()}), folder)

    def log_paths(self, folder: Path, *counts: int) -> tuple[Path, ...]:
        """Returns the paths of all logs, configuration by configuration, realization by realization.

        Args:
            folder: As in `log_path`.
            *counts: Number of configurations, realizations and experiments.
        """
        return tuple(self.log_path(folder, *indices) for indices in np.ndindex(*counts))

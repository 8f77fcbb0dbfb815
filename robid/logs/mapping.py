"""One log file and what its variables are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robid.signals.log_channels import LogChannel, LogOptions


@dataclass(frozen=True, kw_only=True)
class LogMapping(LogOptions):
    """One log file and its channels.

    Attributes:
        file: The log.
        format: `mat` (version 5) or `csv`.
    """

    file: Path
    format: Literal["mat", "csv"] = "mat"

    @property
    def variables(self) -> list[str]:
        """The variables of all channels but the time: inputs, outputs, references."""
        channels: list[LogChannel] = [*self.inputs, *self.outputs, *self.references]
        return [channel.variable for channel in channels]

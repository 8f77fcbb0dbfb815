"""The logs of one recording and what their variables are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from robid.signals.log_channels import LogChannel
from robid.signals.log_options import LogOptions


@dataclass(frozen=True, kw_only=True)
class LogMapping(LogOptions):
    """The logs of one recording and their channels.

    Attributes:
        file: The log.
        files: Further logs, by what their channels call them.
        differs: Whether other logs that are read by the same settings have other clocks.
    """

    file: Path
    files: Mapping[str, Path] = field(default_factory=dict)
    differs: bool = False

    @property
    def channels(self) -> list[LogChannel]:
        """All channels but the time: inputs, outputs, references."""
        return [*self.inputs, *self.outputs, *self.references]

    @property
    def variables(self) -> dict[str, tuple[Path, str]]:
        """Log and variable of each column, the time's last."""
        found = {
            one.column: (self.file if one.file is None else self.files[one.file], one.variable) for one in self.channels
        }
        return found if self.time is None else {**found, self.time.variable: (self.file, self.time.variable)}

    def place(self, column: str) -> str:
        """Says where a column comes from."""
        file, variable = self.variables[column]
        return f"{file}: variable `{variable}`"

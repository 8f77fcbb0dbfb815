"""Describing an artifact, or a log that nobody has described yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robid.artifacts.store import ArtifactDescription, inspect_artifact, kind_of
from robid.commands.output import Answer, print_json
from robid.errors import SettingsError
from robid.pipeline.terminal import Shell, channel_lines, dataset_table, make_console
from robid.signals.log_options import LogFormat

_DIALECT = {"delimiter": "tab", "decimal": ",", "header_line": "3", "encoding": "utf-16"}
"""What can be said of a table on the command line, with examples."""


@dataclass(frozen=True)
class ArtifactAnswer(ArtifactDescription, Answer, type="inspect-artifact"):
    """What is in an artifact."""


@dataclass(frozen=True)
class LogInspection:
    """What the command line says about a log; None for what the log itself tells, or where nobody asks for it."""

    format: LogFormat | None = None
    sampling_period_s: float | None = None
    page: Path | None = None
    experiment: Path | None = None
    dialect: Mapping[str, Any] = field(default_factory=dict)

    @property
    def given(self) -> tuple[str, ...]:
        """Options that were given."""
        named = {
            "--format": self.format,
            "--sampling-period": self.sampling_period_s,
            "--output": self.page,
            "--propose": self.experiment,
            "--dialect": self.dialect or None,
        }
        return tuple(name for name, value in named.items() if value is not None)


def read_dialect(given: Sequence[str]) -> dict[str, Any]:
    """Reads what is said of a table, as `header_line=3`.

    Raises:
        SettingsError: If it is none of what can be said.
    """
    found: dict[str, Any] = {}
    for one in given:
        key, _, value = one.partition("=")
        if key not in _DIALECT or not value or (key == "header_line" and not value.isdigit()):
            remedy = f"say {', '.join(f'`{name}={example}`' for name, example in _DIALECT.items())}"
            raise SettingsError(f"S009 `--dialect {one}` says nothing about a table.", remedy=remedy)
        found[key] = int(value) if key == "header_line" else value
    return found


def is_artifact(path: Path) -> bool:
    """Whether a file is an artifact, or, where it is missing, is named like one."""
    return bool(kind_of(path)) if path.is_file() else path.suffix == ".h5" and not path.exists()


def describe_artifact(paths: Sequence[Path], options: LogInspection, *, as_json: bool) -> int:
    """Prints what an artifact holds and how it came about; returns the exit code.

    Raises:
        SettingsError: If there are several, or an option of logs is given.
    """
    if len(paths) > 1 or options.given:
        what = (
            f"S010 {', '.join(options.given)} belongs to logs."
            if options.given
            else "S011 Artifacts are described one by one."
        )
        raise SettingsError(what, where=str(paths[0]), remedy="`robid inspect ARTIFACT` takes nothing but `--json`")
    found = inspect_artifact(paths[0])
    if as_json:
        print_json(ArtifactAnswer(**vars(found)))
        return 0
    made = found.provenance
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    lines = [
        f"{found.kind} {found.schema_version}, content {found.content_sha256}",
        f"made by {made.stage} at {made.finished_utc} with robid {made.versions.get('robid', 'unknown')}",
        *(f"from {name} {digest}" for name, digest in made.inputs.items()),
        *(f"{name} = {value}" for name, value in found.attributes.items()),
        *channel_lines(found.datasets),
    ]
    for line in lines:
        shell.say(line)
    shell.show(dataset_table(found.datasets))
    return 0

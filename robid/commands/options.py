"""Arguments and options that several commands have, and what a shell completes them with."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

ExperimentFile: TypeAlias = Annotated[Path, typer.Argument(metavar="EXPERIMENT.yaml", help="The experiment file.")]
RunFolder: TypeAlias = Annotated[Path | None, typer.Option("--run-dir", help="The run folder; runs/<name> by default.")]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
Debug: TypeAlias = Annotated[bool, typer.Option("--debug", help="Show tracebacks.")]
Backend: TypeAlias = Annotated[
    Literal["serial", "processes", "dask"] | None, typer.Option("--backend", help="Overrides execution.backend.")
]
Scheduler: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Overrides execution.scheduler: a Dask scheduler, for --backend dask."
    ),
]
Workers: TypeAlias = Annotated[
    int | None, typer.Option("--workers", min=1, max=1000, help="Overrides execution.workers.")
]
Strict: TypeAlias = Annotated[
    bool,
    typer.Option("--strict", help="Exit with 5 unless the model can be trusted, even where it predicts well."),
]


def names_in(section: str) -> Callable[[typer.Context, str], list[str]]:
    """Returns what completes a name by those that a section of the experiment file holds, as in `--campaign`."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        from robid.settings.yaml import load_yaml

        # An option that waits for its value leaves the arguments before it unread. A shell has no place for messages:
        # what cannot be read completes nothing.
        paths = [ctx.params["experiment"], *map(Path, ctx.args)]
        with suppress(Exception):
            names = load_yaml(next(filter(None, paths))).data[section]
            return [name for name in map(str, names) if name.startswith(incomplete)]
        return []

    return complete


def export_formats(incomplete: str) -> list[str]:
    """Completes the format of an export."""
    from robid.models.known import FAMILIES
    from robid.pipeline.export_campaign import FRF_FORMATS

    formats = {*FRF_FORMATS, *(name for family in FAMILIES.values() for name in family.exports)}
    return sorted(name for name in formats if name.startswith(incomplete))


def answering_commands(incomplete: str) -> list[str]:
    """Completes a command whose answer with `--json` has a schema."""
    from robid.commands.answers import ANSWERS

    return [command for command in ANSWERS if command.startswith(incomplete)]


def known_codes(incomplete: str) -> list[str]:
    """Completes the code of a message, or a grade."""
    from robid.commands.explain import GRADES, LETTERS, codes_explained, read_texts

    codes = [code for letter in LETTERS for code in codes_explained(read_texts(letter))]
    codes += ["grades", *(grade for grade in GRADES if " " not in grade)] if incomplete else []
    return [code for code in codes if code.startswith(incomplete)]

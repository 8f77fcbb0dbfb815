"""What commands write for programs: with `--json` one object, whose class declares its keys."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict, dataclass
from typing import Annotated, Any, ClassVar

import typer

from robid.arrays import Meaning
from robid.artifacts.atomic import plain


@dataclass(frozen=True)
class Answer:
    """What a command prints with `--json`; every class of answers has a type and a version of its own.

    A version is `MAJOR.MINOR`: a new key raises the minor; a key that goes, or that contains or means something
    else, raises the major. `robid.commands.answers` lists the classes, `docs/reference/json-output.md` describes them.
    """

    type: ClassVar[str]
    version: ClassVar[str]

    def __init_subclass__(cls, type: str, version: str = "1.0") -> None:  # noqa: A002
        """Names a class of answers."""
        super().__init_subclass__()
        cls.type, cls.version = type, version


@dataclass(frozen=True)
class ErrorAnswer(Answer, type="error"):
    """What is printed in place of a result when a command stops."""

    error: Annotated[str, Meaning("The message, with where it was found and a remedy, as on stderr.")]
    codes: Annotated[tuple[str, ...], Meaning("Codes of its messages; `robid explain` says what they mean.")]
    exit_code: Annotated[int, Meaning("What the command exits with.")]


def print_json(answer: Answer, *, one_line: bool = False) -> None:
    """Prints an answer as JSON, on one line where it is one of a stream; a number that is not finite is null.

    Raises:
        KeyboardInterrupt: If nobody reads any more, as after `| head`; what is printed afterwards goes nowhere.
    """
    told = {"type": answer.type, "json_version": answer.version, **asdict(answer)}
    print_plain(told, one_line=one_line)


def print_plain(value: Any, *, one_line: bool = False) -> None:  # noqa: ANN401
    """Prints any value as JSON, in ASCII, which every encoding of a terminal or pipe holds; see `print_json`."""
    try:
        typer.echo(json.dumps(plain(value), indent=None if one_line else 2, allow_nan=False, default=str))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise KeyboardInterrupt from None

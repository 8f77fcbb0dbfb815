"""What commands write for programs."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import typer


def print_json(value: Any, *, one_line: bool = False) -> None:  # noqa: ANN401
    """Prints a value as JSON, on one line where it is one of a stream.

    Raises:
        KeyboardInterrupt: If nobody reads any more, as after `| head`; what is printed afterwards goes nowhere.
    """
    try:
        typer.echo(json.dumps(value, indent=None if one_line else 2, ensure_ascii=False, default=str))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise KeyboardInterrupt from None

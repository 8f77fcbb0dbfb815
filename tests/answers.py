"""What a command answered: exit code, stdout and stderr."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import dataclass
from typing import Any

from json_answers import check_answer
from robid.cli import run_command


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)

    @property
    def flat(self) -> str:
        return " ".join(self.err.split())


def ask(*arguments: str) -> Answer:
    """Runs a command in this process, in the current directory; what it prints with `--json` must be of its schema."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command(list(arguments))
    if "--json" in arguments and "schema" not in arguments:
        check_answer(arguments, out.getvalue())
    return Answer(code, out.getvalue(), err.getvalue())

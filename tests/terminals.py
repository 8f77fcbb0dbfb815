"""Commands in a terminal of some width, and what its lines show."""

from __future__ import annotations

import contextlib
import io
import re
from unittest import mock

from rich.cells import cell_len
from rich.console import Console

from answers import Answer
from robid.cli import run_command

_ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
_LEFT_OUT = re.compile(r"left out for want of room: (.*?); to be seen (.*?in a terminal of (\d+) columns)")


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def ask_in_terminal(width, *arguments, **environment):
    """Runs a command where both streams lead to a terminal; its answer is without colours."""
    told = {"COLUMNS": str(width), "TERM": "xterm", **environment}
    with mock.patch.dict("os.environ", told), _Terminal() as out, _Terminal() as err:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run_command(list(arguments))
        return Answer(code, *(_ESCAPE.sub("", stream.getvalue()) for stream in (out, err)))


def screen(shown, width, *, is_terminal=True):
    """What a terminal of a width, or a pipe, shows of something, without colours."""
    stream = io.StringIO()
    console = Console(file=stream, width=width, force_terminal=is_terminal, color_system=None)
    console.print(shown, soft_wrap=True)
    return stream.getvalue()


def widest(text):
    """Columns of the widest line; a line that moves is written over itself."""
    return max(cell_len(line.rstrip()) for line in re.split(r"[\r\n]", text))


def numbers(text):
    """Words that begin as numbers do, but those that say what is left out."""
    words = _LEFT_OUT.sub("", " ".join(text.split())).split()
    return {word for word in words if re.match(r"[(±+\u2212-]*\d", word)}


def left_out(text):
    """Heads of the columns that a line names as left out, where they are, and the columns that all need."""
    found = _LEFT_OUT.search(" ".join(text.split()))
    return (found[1].split(", "), found[2], int(found[3])) if found else ([], "", 0)

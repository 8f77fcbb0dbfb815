"""Sentences in a terminal: wrapped between words, never within a path, a name or a number."""

from __future__ import annotations

import os
import re
import textwrap
from typing import TextIO

WIDEST = 100
"""Columns up to which a sentence is easy to read, however wide the terminal is."""

_COMMAND = re.compile(r"`[^`\n]+`")
_BEFORE_UNIT = re.compile(r"(?<!\S)([(±+\u2212-]*[\d.]*\d) (?=[^\W\d]|%)")
_HANGING = "  "
_USUAL_WIDTH = 80
_UNBROKEN = "\0"


def wrap(text: str, width: int | None) -> str:
    """Wraps each line of a text for a terminal of a width, what follows indented; without a terminal a line is a line.

    A command in backticks stays on one line where one holds it, so that it can be copied; so do a number and its unit.
    """
    if width is None:
        return text
    return "\n".join(_wrapped(line, min(width, WIDEST)) for line in text.split("\n"))


def _wrapped(line: str, width: int) -> str:
    indent = line[: len(line) - len(line.lstrip())] + _HANGING
    room = width - len(indent)
    kept = _COMMAND.sub(lambda found: found[0].replace(" ", _UNBROKEN) if len(found[0]) <= room else found[0], line)
    kept = _BEFORE_UNIT.sub(rf"\1{_UNBROKEN}", kept)
    wrapper = textwrap.TextWrapper(
        max(width, len(indent) + 1),
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
    return wrapper.fill(kept).replace(_UNBROKEN, " ")


def terminal_width(stream: TextIO) -> int | None:
    """Returns how many columns the terminal has that a stream leads to; None where it leads to none."""
    if not stream.isatty():
        return None
    stated = os.environ.get("COLUMNS", "")
    try:
        return int(stated) if stated.isdigit() else os.get_terminal_size(stream.fileno()).columns or _USUAL_WIDTH
    except OSError:
        return _USUAL_WIDTH

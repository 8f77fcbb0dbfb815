"""Standard output and error, prepared once: they show any text in any encoding, and fail with one message."""

from __future__ import annotations

import codecs
import os
import sys
from io import TextIOWrapper
from typing import Any

from robid.errors import BackendError

_ERRORS = "robid.plain"
_PLAIN = {
    **dict(zip("±…−–—µμ×·⋅→", ("+-", "...", "-", "-", "-", "u", "u", "x", ".", ".", "->"), strict=True)),  # noqa: RUF001
    **dict(zip("≤≥≈∞°‰\u00a0━─│", ("<=", ">=", "~", "inf", "deg", "1/1000", " ", "#", "-", "|"), strict=True)),
    **dict(zip("“”‘’✓✗", ('"', '"', "'", "'", "yes", "no"), strict=True)),  # noqa: RUF001
    **{raised: f"^{digit}" for digit, raised in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")},
}
"""What stands for a character that an encoding does not have; for others their escapes do."""


def prepare_streams() -> None:
    """Gives this process streams that know no error of encoding, and say once that they cannot be written."""
    codecs.register_error(_ERRORS, _replaced)
    sys.stdout = sys.__stdout__ = _prepared(sys.stdout, 1, _Results)  # type: ignore[misc]
    sys.stderr = sys.__stderr__ = _prepared(sys.stderr, 2, _Messages)  # type: ignore[misc]


def _prepared(stream: Any, number: int, kind: type[_Stream]) -> _Stream:  # noqa: ANN401  None where it is closed
    if stream is None:
        # The next file that is opened would get its number, and what libraries print would go into that file.
        _to_nowhere(number)
        stream = os.fdopen(number, "w", encoding="utf-8", closefd=False)
    # typer writes UTF-8 past a stream that says it is ASCII; this one says UTF-8, and replaces the rest itself.
    is_ascii = codecs.lookup(stream.encoding).name == "ascii"
    encoding, by_line, at_once = "utf-8" if is_ascii else stream.encoding, stream.line_buffering, stream.write_through
    prepared = kind(stream.detach(), encoding, _ERRORS, line_buffering=by_line, write_through=at_once)
    prepared.is_ascii = is_ascii
    return prepared


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(_PLAIN.get(each) or ascii(each)[1:-1] for each in lost), error.end


def _to_nowhere(number: int) -> None:
    """Has a descriptor lead to the null device, as nothing can be written where it led."""
    null = os.open(os.devnull, os.O_WRONLY)
    if null != number:
        os.dup2(null, number)
        os.close(null)


class _Stream(TextIOWrapper):
    """A stream of this process that goes nowhere after its first failure."""

    is_ascii = False  # whether it leads to what shows ASCII alone

    def write(self, text: str) -> int:
        if text == "":
            return 0  # the full disk refuses even nothing, and typer asks so what a stream takes
        if self.is_ascii:
            text = text.encode("ascii", _ERRORS).decode("ascii")
        try:
            return super().write(text)
        except OSError as error:
            self._fail(error)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        _to_nowhere(self.fileno())
        self._tell(error)

    def _tell(self, error: OSError) -> None:
        raise NotImplementedError


class _Results(_Stream):
    """Standard output: a result that cannot be written is an error, one that nobody reads an interrupt."""

    def _tell(self, error: OSError) -> None:
        if isinstance(error, BrokenPipeError):
            raise KeyboardInterrupt from None
        what = f"B013 Standard output cannot be written: {error.strerror}."
        raise BackendError(what, remedy="send it elsewhere; files that are written are whole") from None


class _Messages(_Stream):
    """Standard error: work does not end because a message cannot be shown."""

    def _tell(self, error: OSError) -> None:
        pass

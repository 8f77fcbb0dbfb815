"""Text that is safe to show: what a file or a name contains does not steer the terminal."""

from __future__ import annotations

_NO_BLANKS = "\t\n\v\f\r\x1c\x1d\x1e\x1f\x85\u2028\u2029"


def printable(text: str, keep: str = "\n\t") -> str:
    r"""Writes control characters, marks of direction and halves of surrogate pairs as escapes, as `\x1b`.

    Args:
        text: What is to be shown.
        keep: Control characters that stay; none of them in what must not leave its line, as a name.
    """
    if text.isprintable():
        return text
    return "".join(each if _is_safe(each) or each in keep else ascii(each)[1:-1] for each in text)


def _is_safe(each: str) -> bool:
    return each.isprintable() or (each.isspace() and each not in _NO_BLANKS)

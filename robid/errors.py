"""Errors that a user can cause; each says what is wrong, where, and what to do next.

Every message begins with its code where it is written, as in `D017 The log has no signals`: a letter for settings (S),
data (D), artifacts (A), what computes (B) or findings about results (F), and a number that stays when the words change.
"""

from __future__ import annotations

import re
from importlib.util import find_spec

from robid.printable import printable

_CODE = re.compile(r"(?<![\w`'\"./-])[SDABF]\d{3}(?= |$|\))")


class RobidError(Exception):
    """A problem that the user can solve.

    Args:
        what: What is wrong, in one sentence.
        where: The file and field, dataset or configuration it was found in.
        remedy: What to do next.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.where = where
        self.remedy = remedy

    def __str__(self) -> str:
        where = printable(self.where, keep="")
        parts = [f"{where}: {self.what}" if self.where else self.what]
        if self.remedy:
            parts.append(f"  remedy: {self.remedy}")
        return "\n".join(parts)

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of the messages that it holds, in their order."""
        return codes_in(str(self))

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (type(self), self.what, self.where, self.remedy))


def codes_in(text: str) -> tuple[str, ...]:
    """Returns the codes of the messages in a text, each once, in their order."""
    return tuple(dict.fromkeys(_CODE.findall(text)))


class SettingsError(RobidError):
    """The experiment or robot file, or the command line, asks for something that cannot be."""

    exit_code = 2


class ArtifactError(RobidError):
    """An artifact is missing, stale, damaged or of an unknown version."""

    exit_code = 3


class DataError(RobidError):
    """The data, measured or simulated, cannot be used as they are."""

    exit_code = 4


class BackendError(RobidError):
    """What computes cannot: a scheduler, its workers, or worker processes."""

    exit_code = 3


class WorkerError(BackendError):
    """A task has ended the process that it was given to."""


def require_module(module: str, extra: str, purpose: str) -> None:
    """Refuses what needs a module that is not installed, with the command that installs it.

    Args:
        module: Name of the module.
        extra: The extra of robid that installs it.
        purpose: What needs it, as in `Writing UFF58`.

    Raises:
        SettingsError: If it is missing.
    """
    if find_spec(module) is None:
        remedy = f"install it with `pip install 'robid[{extra}]'`"
        raise SettingsError(f"S035 {purpose} needs the package {module}, which is not installed", remedy=remedy)


def _rebuild(kind: type[RobidError], what: str, where: str, remedy: str) -> RobidError:
    return kind(what, where=where, remedy=remedy)

"""Saying whether an installation works, and what would make it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from robid.arrays import Meaning
from robid.commands.installation import Check, installation
from robid.commands.output import Answer, print_json
from robid.commands.shared import PROBLEM
from robid.commands.trial import backends, identification
from robid.errors import codes_in
from robid.pipeline.terminal import Shell, make_console
from robid.report.terminal_table import Column, TerminalTable
from robid.versions import package_versions

_MARKS = {"ok": "ok", "failed": "FAILED", "absent": "-"}


@dataclass(frozen=True)
class Checked(Check):
    """What a check found, with the codes in it."""

    codes: Annotated[tuple[str, ...], Meaning("Codes of its message.")] = ()


@dataclass(frozen=True)
class DoctorAnswer(Answer, type="doctor"):
    """Whether an installation works."""

    ok: Annotated[bool, Meaning("Whether no check has failed.")]
    versions: Annotated[dict[str, str], Meaning("Versions of Python, robid and the packages that decide its numbers.")]
    checks: Annotated[tuple[Checked, ...], Meaning("What was looked at.")]


def examine_installation(*, as_json: bool) -> int:
    """Checks packages, backends and a small identification; returns the exit code."""
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=as_json)
    checks = list(_checks(shell))
    failed = [check for check in checks if check.status == "failed"]
    if as_json:
        rows = (Checked(**vars(check), codes=codes_in(check.text)) for check in checks)
        print_json(DoctorAnswer(not failed, package_versions(), tuple(rows)))
        return PROBLEM if failed else 0
    table = TerminalTable([Column(title, numbers=False) for title in ("check", "", "found")])
    for check in checks:
        remedy = f"; {check.remedy} adds it" if check.status == "absent" else ""
        table.add(check.name, _MARKS[check.status], check.text + remedy)
    shell.show(table)
    for check in failed:
        shell.warn(f"{check.name}: {check.text}\n  remedy: {check.remedy}")
    shell.say("\nAll works." if not failed else f"\n{len(failed)} of {len(checks)} checks failed.")
    return PROBLEM if failed else 0


def _checks(shell: Shell) -> Iterator[Check]:
    """All checks; what computes is only asked where its packages are there."""
    found = list(installation())
    yield from found
    if any(check.status == "failed" for check in found):
        return
    shell.note("doctor", "starting a worker of each backend")
    yield from backends()
    shell.note("doctor", "identifying a simulated drive")
    yield identification()

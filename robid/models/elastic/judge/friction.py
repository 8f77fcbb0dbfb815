"""What to do where the friction that was subtracted is not that of the robot: identify it, or play what shows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from robid.frf.frf import Frf
from robid.frf.silent import MIN_LINES, telling_count
from robid.results.finding import Finding

_TRIES = "try `"  # What a finding has that says what to free
_BY_LOAD = "play a larger excitation, so that motors slide: no `compensation` knows friction that grows with the load"


def with_friction_remedies(findings: Iterable[Finding], frf: Frf, *, by_load: bool = False) -> list[Finding]:
    """Returns findings, those that point to friction with what to do where they do not say it themselves.

    Args:
        findings: Findings about a fit.
        frf: The response that it was fitted to.
        by_load: Whether the fit estimates friction that grows with the load.
    """
    told = _BY_LOAD if by_load else friction_remedy(frf)
    return [
        replace(each, message=f"{each.message} ({told})")
        if each.cause == "friction" and _TRIES not in each.message
        else each
        for each in findings
    ]


def friction_remedy(frf: Frf) -> str:
    """Says how the law of friction is found where the one that was subtracted is off.

    Lines that stay silent show friction and nothing else. Where the record has enough of them they are to be used;
    else a longer period, whose lines lie closer, leaves them silent.
    """
    if not frf.has_record:
        return (
            "a response alone does not show it: measure with a larger amplitude, so that motors slide, or bring a"
            " record, from which `compensation` can take friction"
        )
    other = "`compensation: {fit: NAME}` takes friction from a rigid fit of large, slow motions"
    if frf.compensation == "silent_lines":
        return f"play a larger excitation, so that motors slide, or another one: {other}"
    if not frf.silent_lines.size:
        return f"play a periodic excitation that leaves lines silent, with `compensation: silent_lines`; or {other}"
    telling = telling_count(frf.silent_lines, frf.lines)
    if telling >= MIN_LINES:
        return "try `compensation: silent_lines` in the campaign's `estimate`"
    # In a period that is longer by a factor as many times more lines lie in the band, of which the excited ones stay.
    excited = frf.lines.size
    factor = int(np.ceil((MIN_LINES + excited) / (telling + excited)))
    period_s = round(float(frf.lines[0] / frf.frequency_hz[0]), 9)
    return (
        f"{telling} silent lines can show friction, and it takes {MIN_LINES}: play as many lines in `period_s: "
        f"{factor * period_s:.6g}` instead of {period_s:.6g}, with `compensation: silent_lines`"
    )

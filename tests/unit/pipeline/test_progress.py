"""Where there is no terminal, a line says now and then how far something is."""

from io import StringIO

import pytest
from rich.console import Console

from robid.pipeline import terminal
from robid.pipeline.terminal import Shell


@pytest.fixture
def clock(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    return now


def shell(*, quiet=False, is_terminal=False):
    err = Console(file=StringIO(), width=200, force_terminal=is_terminal)
    return Shell(Console(file=StringIO()), err, quiet), err.file


def work(shown, clock, seconds, done=0, total=10):
    with shown.progress("tasks/responses") as bar:
        bar.expect(total, "tasks", done)
        for took in seconds:
            clock[0] += took
            bar.advance()


def test_a_line_at_most_every_half_minute_tells_how_long_the_rest_takes(clock):
    shown, told = shell()
    work(shown, clock, [20.0] * 10)
    assert told.getvalue().splitlines() == [
        "tasks/responses  2 of 10 tasks done, 2 min 40 s left",
        "tasks/responses  4 of 10 tasks done, 2 min 00 s left",
        "tasks/responses  6 of 10 tasks done, 1 min 20 s left",
        "tasks/responses  8 of 10 tasks done, 40 s left",
        "tasks/responses  10 of 10 tasks done",
    ]


def test_what_an_earlier_run_did_says_nothing_of_the_pace(clock):
    shown, told = shell()
    work(shown, clock, [60.0], done=8)
    assert told.getvalue().splitlines()[1:] == ["tasks/responses  9 of 10 tasks done, 1 min 00 s left"]


@pytest.mark.parametrize("options", [{"quiet": True}, {"is_terminal": True}])
def test_no_line_where_it_is_quiet_or_a_bar_is_shown(clock, options):
    shown, told = shell(**options)
    work(shown, clock, [40.0] * 10)
    assert "done" not in told.getvalue()


def test_what_is_soon_done_says_nothing(clock):
    shown, told = shell()
    work(shown, clock, [2.0] * 10)
    assert told.getvalue() == ""

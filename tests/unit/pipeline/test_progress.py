"""How far something is: a line that moves in a terminal, a line now and then elsewhere, and never a wrong promise."""

import heapq
import re
from io import StringIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from robid.pipeline import terminal
from robid.pipeline.progress import Pace, Standing, clock, roughly, shortened
from robid.pipeline.terminal import Shell


@pytest.fixture
def clocked(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    return now


def shell(*, quiet=False, is_terminal=False, width=200):
    err = Console(file=StringIO(), width=width, force_terminal=is_terminal, force_interactive=is_terminal)
    return Shell(Console(file=StringIO()), err, quiet), err.file


def work(shown, clocked, seconds, done=0, total=10):
    with shown.progress("tasks/responses") as bar:
        bar.expect(total, "tasks", done)
        for took in seconds:
            clocked[0] += took
            bar.advance()
        return bar.shown().plain


def test_a_line_at_most_every_half_minute_tells_how_long_the_rest_takes_once_that_is_known(clocked):
    shown, told = shell()
    work(shown, clocked, [20.0] * 10)
    assert told.getvalue().splitlines() == [
        "tasks/responses  2 of 10 tasks done",
        "tasks/responses  4 of 10 tasks done, about 2 min left",
        "tasks/responses  6 of 10 tasks done, about 1 min 20 s left",
        "tasks/responses  8 of 10 tasks done, about 40 s left",
        "tasks/responses  10 of 10 tasks done",
    ]


def test_what_an_earlier_run_did_says_nothing_of_the_pace(clocked):
    shown, told = shell()
    work(shown, clocked, [60.0] * 3, done=6)
    assert told.getvalue().splitlines()[-1] == "tasks/responses  9 of 10 tasks done, about 1 min left"


@pytest.mark.parametrize("options", [{"quiet": True}, {"is_terminal": True}])
def test_no_line_where_it_is_quiet_or_a_bar_is_shown(clocked, options):
    shown, told = shell(**options)
    work(shown, clocked, [40.0] * 10)
    assert "done" not in told.getvalue()


def test_what_is_soon_done_says_nothing(clocked):
    shown, told = shell()
    work(shown, clocked, [2.0] * 10)
    assert told.getvalue() == ""


def test_the_line_says_what_how_many_how_long_and_what_is_left(clocked):
    shown, _ = shell(is_terminal=True)
    assert re.fullmatch(
        r"tasks/responses  ━+─+  5 of 10 tasks, ~1 min 40 s left  1:40", work(shown, clocked, [20.0] * 5)
    )


def test_a_dumb_terminal_gets_lines(clocked, monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    err = Console(file=StringIO(), force_terminal=True)
    work(Shell(err, err, quiet=False), clocked, [40.0] * 3)
    assert "\x1b" not in err.file.getvalue()
    assert "tasks/responses  1 of 10 tasks done" in err.file.getvalue()


def test_colours_in_a_pipe_bring_no_line_that_moves(clocked):
    err = Console(file=StringIO(), width=200, force_terminal=True, force_interactive=False)
    work(Shell(err, err, quiet=False), clocked, [40.0] * 3)
    assert len(err.file.getvalue().splitlines()) == 3
    assert not re.search(r"\r|\x1b\[\??\d*[A-Zhl]", err.file.getvalue())


def ends_of(lengths, workers):
    """When tasks end that begin in order, each on the first worker that is free."""
    free, ends = [0.0] * workers, []
    for length in lengths:
        ends.append(heapq.heappop(free) + length)
        heapq.heappush(free, ends[-1])
    return sorted(ends)


def pace_at(ends, now, workers):
    done = [end for end in ends if end <= now]
    return Pace(workers, 0.0, done).left_s(len(ends) - len(done), now)


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
def test_the_rest_of_equal_tasks_is_told_exactly_or_not_at_all(workers):
    ends = ends_of([10.0] * 50, workers)
    moments = np.arange(0.5, ends[-1], 1.0)
    told = [pace_at(ends, now, workers) for now in moments]
    known = [left is not None for left in told]
    assert not any(known[:29])  # three rounds of 10 s
    assert all(known[30:])
    for left, now in zip(told, moments, strict=True):
        assert left is None or left == pytest.approx(ends[-1] - now)


@pytest.mark.parametrize("workers", [1, 2, 4])
@pytest.mark.parametrize("scatter", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("count", [8, 20, 60])
def test_what_is_told_of_unequal_tasks_is_seldom_wrong_by_a_factor_of_two(workers, scatter, count):
    rng = np.random.default_rng(5)
    wrong, moments = 0, 0
    for _ in range(40):
        ends = ends_of(rng.lognormal(0.0, scatter, count), workers)
        for now in rng.uniform(0.0, 0.95, 20) * ends[-1]:
            left, moments = pace_at(ends, now, workers), moments + 1
            wrong += left is not None and not 0.5 < left / (ends[-1] - now) < 2.0
    assert wrong / moments < 0.07


def test_a_late_first_result_promises_nothing_and_a_late_last_one_takes_its_promise_back():
    assert Pace(1, 0.0, [30.0, 31.0, 32.0, 33.0]).left_s(20, 33.0) is None
    steady = Pace(1, 0.0, [1.0, 2.0, 3.0, 4.0])
    assert steady.left_s(1, 4.5) == pytest.approx(0.5)
    assert steady.left_s(1, 6.0) is None
    assert steady.left_s(0, 4.0) is None


def test_two_workers_that_end_in_turn_end_in_turn_to_the_last():
    steady = Pace(2, 0.0, [5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
    assert [steady.left_s(remaining, 31.0) for remaining in (1, 2, 3, 4)] == pytest.approx([4.0, 9.0, 14.0, 19.0])


@given(
    label=st.text("abc/._", min_size=1, max_size=80),
    place=st.sampled_from(["", "3 of 7", "12 of 14"]),
    elapsed_s=st.floats(0.0, 2e5),
    left_s=st.none() | st.floats(0.1, 2e5),
    total=st.integers(0, 99999),
    share=st.just(1.0) | st.floats(0.0, 1.0),
    width=st.integers(40, 200),
)
def test_the_line_fits_and_its_numbers_are_whole(label, place, elapsed_s, left_s, total, share, width):
    done = int(share * total)
    standing = Standing(label, place, elapsed_s, left_s, done, total, "configurations")
    line = "".join(text for text, _ in standing.line(width))
    assert len(line) < width
    assert clock(elapsed_s) in line.split("  ")
    assert (f"{done} of {total}" in line) is (total > 1)
    assert ("configurations" in line) is (total > 1) or width < 50
    if total > 1 and left_s is not None and width >= 80:
        assert f"{done} of {total} configurations, ~{roughly(left_s)} left" in line
    if width >= 100:
        assert line.startswith(place)
    bar = re.findall("[━─]+", line)
    assert len(bar) <= (done < total > 1)
    if bar:
        assert bar[0].count("━") / len(bar[0]) <= done / total < (bar[0].count("━") + 1) / len(bar[0]) + 1e-9


def test_the_longest_numbers_leave_no_room_for_words():
    line = "".join(text for text, _ in Standing("rows", "", 2e5, None, 99999, 99999, "configurations").line(40))
    assert len(line) < 40
    assert "99999 of 99999  55:33:20" in line


def test_what_is_not_counted_turns_and_shows_no_bar():
    turns = {"".join(text for text, _ in Standing("fits/a", "", at, total=1, unit="fits").line(80)) for at in range(4)}
    turns |= {"".join(text for text, _ in Standing("fits/a", "", at / 4).line(80)) for at in range(4)}
    assert not any("━" in line or "─" in line or "of" in line for line in turns)
    assert len({line.split()[1] for line in turns}) > 1


def test_what_comes_after_the_last_task_turns_too():
    lines = {
        "".join(text for text, _ in Standing("fits/a", "", at / 4, None, 8, 8, "starts").line(80)) for at in range(4)
    }
    assert len(lines) > 1
    assert all("8 of 8 starts" in line and "━" not in line for line in lines)


@pytest.mark.parametrize("width", [80, 100])
def test_what_is_done_uncounted_is_said(width):
    line = "".join(text for text, _ in Standing("fits/a", "8 of 10", 65.0, None, 0, 0, "intervals").line(width))
    assert "intervals" in line
    assert "0 of 0" not in line
    assert len(line) < width


def test_a_label_keeps_both_ends():
    assert shortened("campaign_of_june/excitation.h5", 40) == "campaign_of_june/excitation.h5"
    short = shortened("campaign_of_june/excitation.h5", 20)
    assert len(short) == 20
    assert short.startswith("campaign")
    assert short.endswith("tation.h5")


@pytest.mark.parametrize(
    ("seconds", "told"),
    [
        *((0.2, "5 s"), (42.4, "40 s"), (59.0, "1 min"), (157.0, "2 min 40 s")),
        *((600.0, "10 min"), (3599.0, "1 h"), (5000.0, "1 h 20 min"), (86000.0, "23 h 50 min")),
    ],
)
def test_what_is_left_is_told_no_more_closely_than_it_is_known(seconds, told):
    assert roughly(seconds) == told


def test_elapsed_time_is_a_clock():
    assert [clock(seconds) for seconds in (0.9, 61.0, 3599.9, 3661.0)] == ["0:00", "1:01", "59:59", "1:01:01"]

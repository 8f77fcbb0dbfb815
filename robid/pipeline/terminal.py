"""What the user sees while stages run and when they ask what there is."""

from __future__ import annotations

import os
import textwrap
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from robid.report.numbers import duration

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID
    from rich.table import Table

LINE_EVERY_S = 30.0
"""How often a line says how far something is where there is no terminal [s]."""

_PLAIN_WIDTH = 200
_COLOURS = {"fresh": 32, "stale": 33, "missing": 31}
_STATUS = ("output", "status", "why")


def make_console(*, stderr: bool) -> Console:
    """Returns a console that does not fold lines at 80 columns where there is no terminal."""
    from rich.console import Console

    console = Console(stderr=stderr)
    return console if console.is_terminal else Console(stderr=stderr, width=_PLAIN_WIDTH)


@dataclass(frozen=True)
class Shell:
    """Where results, messages and progress go."""

    out: Console  # results
    err: Console  # messages and progress
    quiet: bool  # whether progress and messages that are no warnings are left out

    def say(self, text: str) -> None:
        """Prints a result as it is."""
        _print(self.out, text)

    def note(self, subject: str, text: str) -> None:
        """Prints a message about something, unless quiet."""
        if not self.quiet:
            _print(self.err, f"{subject}  {text}", bold=len(subject))

    def warn(self, text: str) -> None:
        """Prints a warning."""
        _print(self.err, f"warning: {text}", "yellow")

    @contextmanager
    def progress(self, label: str) -> Iterator[Bar]:
        """Shows a bar while something is made; where there is no terminal, a line now and then."""
        from rich import progress as shown

        columns = (
            *(shown.TextColumn("{task.description}"), shown.BarColumn(bar_width=24), shown.MofNCompleteColumn()),
            *(shown.TextColumn("{task.fields[unit]}"), shown.TimeElapsedColumn()),
            *(shown.TextColumn("left"), shown.TimeRemainingColumn()),
        )
        hidden = self.quiet or not self.err.is_terminal
        with shown.Progress(*columns, console=self.err, transient=True, disable=hidden) as bars:
            yield Bar(self, label, bars, bars.add_task(label, total=None, unit=""))


@dataclass
class Bar:
    """The progress of one stage, or of one step of a study."""

    shell: Shell  # where it is shown
    label: str  # what is made
    bars: Progress  # the bar, hidden where there is no terminal
    task: TaskID  # its own in there
    unit: str = ""  # what is counted
    total: int = 0  # how many tasks there are
    done: int = 0  # how many of them are done
    since: int = 0  # how many of them since it began
    begun: float = 0.0  # when it did [s]
    told: float = 0.0  # when a line last said how far it is [s]

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Says how many tasks there are, and how many of them an earlier run did."""
        self.bars.update(self.task, total=total, completed=done, unit=unit)
        self.unit, self.total, self.done, self.since = unit, total, done, 0
        self.begun = self.told = time.monotonic()
        if done:
            self.shell.note(self.label, f"{done} of {total} {unit} are there from an earlier run")

    def advance(self) -> None:
        """Says that one more is done."""
        self.bars.advance(self.task)
        self.done, self.since = self.done + 1, self.since + 1
        now = time.monotonic()
        if not self.shell.err.is_terminal and now - self.told >= LINE_EVERY_S:
            self.told = now
            left = (now - self.begun) / self.since * (self.total - self.done)
            # Nobody knows the time that is left to a tenth of a second.
            rest = f", {f'{left:.0f} s' if left < 59.5 else duration(left)} left" if left > 0 else ""
            self.shell.note(self.label, f"{self.done} of {self.total} {self.unit} done{rest}")

    def warn(self, text: str) -> None:
        """Tells what the user should know before using the result."""
        self.shell.warn(f"{self.label}: {text}")


def _print(console: Console, text: str, style: str = "", bold: int = 0) -> None:
    """Wraps between words in a terminal, never within one, so that paths stay whole; elsewhere a line is a line."""
    from rich.text import Text

    if console.is_terminal:
        wrapper = textwrap.TextWrapper(
            console.width, break_long_words=False, break_on_hyphens=False, replace_whitespace=False
        )
        text = "\n".join(wrapper.fill(line) for line in text.split("\n"))
    shown = Text(text, style)
    shown.stylize("bold", 0, bold)
    console.print(shown, soft_wrap=True, highlight=False)


def status_lines(rows: Sequence[tuple[str, str, str]], width: int | None) -> list[str]:
    """Lays out output, status and why, in columns; without a terminal there is neither a width to keep nor colour."""
    first, second = (max(len(row[column]) for row in (_STATUS, *rows)) for column in (0, 1))
    indent = first + second + 4
    lines = []
    for output, status, why in (_STATUS, *rows):
        told = textwrap.wrap(why, max(width - indent, 20)) if width else [why]
        shown = f"{status:{second}}"
        if width and "NO_COLOR" not in os.environ:
            shown = f"\x1b[{_COLOURS.get(status, 2)}m{shown}\x1b[0m"
        lines += [
            f"{output:{first}}  {shown}  {''.join(told[:1])}".rstrip(),
            *(" " * indent + more for more in told[1:]),
        ]
    return lines


def channel_lines(datasets: dict[str, dict[str, Any]]) -> list[str]:
    """Says what the channels of an artifact are: `input_channels: motor torque of turn [N m], ...`."""
    lines = []
    for name in (path.removesuffix("/quantity") for path in datasets if path.endswith("_channels/quantity")):
        parts = (datasets[f"{name}/{part}"].get("values", []) for part in ("side", "quantity", "name", "unit"))
        told = (
            f"{side} {kind.replace('_', ' ')} of {channel} [{unit}]"
            for side, kind, channel, unit in zip(*parts, strict=True)
        )
        lines.append(f"{name}: {', '.join(told)}")
    return lines


def dataset_table(datasets: dict[str, dict[str, Any]]) -> Table:
    """Lays out what an artifact holds."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in ("dataset", "shape", "type", "units", "axes", "what"):
        table.add_column(name, no_wrap=name != "what")
    for name, row in datasets.items():
        shape = " x ".join(map(str, row["shape"]))
        table.add_row(name, shape, row["dtype"], row["units"], ", ".join(row["axes"]), row.get("description", ""))
    return table


def section_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Lays out a table of a study, its first column naming the row."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="dim", title=title, title_justify="left")
    for index, name in enumerate(columns):
        table.add_column(escape(name), justify="right" if index else "left")
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table

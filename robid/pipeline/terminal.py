"""What the user sees while stages run and when they ask what there is."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from robid.pipeline.progress import Pace, Standing, roughly
from robid.printable import printable
from robid.report.wrapping import WIDEST, wrap

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

    from robid.artifacts.store import DatasetDescription
    from robid.report.terminal_table import TerminalTable

LINE_EVERY_S = 30.0
"""How often a line says how far something is where there is no terminal [s]."""

_PLAIN_WIDTH = 200
_COLOURS = {"fresh": 32, "stale": 33, "missing": 31}
_COLOURLESS = ("dumb", "unknown")
_STATUS = ("output", "status", "why")
_SHORTEST_WHY = 20  # columns
_NUMBERS = 24  # columns of the longest cell that is taken for numbers


def make_console(*, stderr: bool) -> Console:
    """Returns a console that does not fold lines at 80 columns where there is no terminal."""
    from rich.console import Console

    if (sys.stderr if stderr else sys.stdout).isatty():
        return Console(stderr=stderr)
    # Colours may be wanted even so, a line that moves is not.
    return Console(stderr=stderr, width=_PLAIN_WIDTH, force_interactive=False)


@dataclass(frozen=True)
class Shell:
    """Where results, messages and progress go."""

    out: Console  # results
    err: Console  # messages and progress
    quiet: bool  # whether progress and messages that are no warnings are left out

    def say(self, text: str, *, as_it_is: bool = False) -> None:
        """Prints a result, wrapped in a terminal; as it is where the lines of a file are shown."""
        _print(self.out, text, as_it_is=as_it_is)

    def show(self, shown: RenderableType | None) -> None:
        """Prints a table and the like; where there is no terminal, lines are as long as they are."""
        if shown is not None:
            self.out.print(shown, soft_wrap=True)

    def note(self, subject: str, text: str) -> None:
        """Prints a message about something, unless quiet."""
        if not self.quiet:
            _print(self.err, f"{subject}  {text}", bold=len(subject))

    def warn(self, text: str) -> None:
        """Prints a warning."""
        _print(self.err, f"warning: {text}", "yellow")

    @contextmanager
    def progress(self, label: str, place: str = "", workers: int = 1) -> Iterator[Bar]:
        """Shows a bar while something is made; where there is no terminal, a line now and then.

        It is one of several where a place is named, as in `3 of 7`; so many tasks of it run at a time as have workers.
        """
        bar = Bar(self, label, place, workers)
        if self.quiet or not self.err.is_interactive:
            yield bar
            return
        from rich.live import Live

        # Results go where standard output leads, not in between.
        with Live(get_renderable=bar.shown, console=self.err, transient=True, redirect_stdout=False):
            yield bar


@dataclass
class Bar:
    """The progress of one stage, or of one step of a study."""

    shell: Shell  # where it is shown
    label: str  # what is made
    place: str = ""  # which of how many it is
    workers: int = 1  # how many tasks run at a time
    unit: str = ""  # what is counted
    total: int = 0  # how many tasks there are
    done: int = 0  # how many of them are done
    pace: Pace = field(init=False)  # when they were
    begun: float = field(init=False)  # when it began [s]
    told: float = field(init=False)  # when a line last said how far it is [s]

    def __post_init__(self) -> None:
        """Starts the clock."""
        self.begun = self.told = time.monotonic()
        self.pace = Pace(self.workers, self.begun)

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Says how many tasks there are, and how many of them an earlier run did."""
        self.unit, self.total, self.done, self.told = unit, total, done, time.monotonic()
        self.pace = Pace(self.workers, self.told)
        if done:
            self.shell.note(self.label, f"{done} of {total} {unit} are there from an earlier run")

    def advance(self) -> None:
        """Says that one more is done."""
        now = time.monotonic()
        self.done += 1
        self.pace.ends.append(now)
        if not self.shell.err.is_interactive and now - self.told >= LINE_EVERY_S:
            self.told = now
            left = self.pace.left_s(self.total - self.done, now)
            rest = "" if left is None else f", about {roughly(left)} left"
            self.shell.note(self.label, f"{self.done} of {self.total} {self.unit} done{rest}")

    def shown(self) -> Text:
        """Returns the line that says how far it is, for the terminal as wide as it is now."""
        from rich.text import Text

        now, console = time.monotonic(), self.shell.err
        left = self.pace.left_s(self.total - self.done, now)
        standing = Standing(
            printable(self.label, ""), self.place, now - self.begun, left, self.done, self.total, self.unit
        )
        plain = not console.encoding.lower().startswith("utf")
        return Text.assemble(*standing.line(console.width, plain=plain), no_wrap=True, overflow="ignore")

    def warn(self, text: str) -> None:
        """Tells what the user should know before using the result."""
        self.shell.warn(f"{self.label}: {text}")


def _print(console: Console, text: str, style: str = "", bold: int = 0, *, as_it_is: bool = False) -> None:
    from rich.text import Text

    width = console.width if console.is_terminal and not as_it_is else None
    shown = Text(wrap(printable(text), width), style)
    shown.stylize("bold", 0, bold)
    console.print(shown, soft_wrap=True, highlight=False)


def status_lines(
    rows: Sequence[tuple[str, str, str]], width: int | None, head: tuple[str, str, str] = _STATUS
) -> list[str]:
    """Lays out output, status and why, in columns; without a terminal there is neither a width to keep nor colour."""
    first, second = (max(len(row[column]) for row in (head, *rows)) for column in (0, 1))
    indent = first + second + 4
    coloured = width and not os.environ.get("NO_COLOR") and os.environ.get("TERM") not in _COLOURLESS
    lines = []
    for output, status, why in (head, *(tuple(printable(cell, "") for cell in row) for row in rows)):
        shown = f"{status:{second}}"
        if coloured:
            shown = f"\x1b[{_COLOURS.get(status, 2)}m{shown}\x1b[0m"
        begin = f"{output:{first}}  {shown}"
        if width and width - indent < _SHORTEST_WHY:
            # Beside the others it would be a column of single words.
            lines += [begin.rstrip(), *(wrap(f"    {why}", width).split("\n") if why else [])]
            continue
        told = wrap(why, min(width, WIDEST) - indent).split("\n") if width else [why]
        lines += [f"{begin}  {told[0]}".rstrip(), *(" " * indent + more for more in told[1:])]
    return lines


def channel_lines(datasets: Mapping[str, DatasetDescription]) -> list[str]:
    """Says what the channels of an artifact are: `input_channels: motor torque of turn [N m], ...`."""
    lines = []
    for name in (path.removesuffix("/quantity") for path in datasets if path.endswith("_channels/quantity")):
        parts = (datasets[f"{name}/{part}"].values or [] for part in ("side", "quantity", "name", "unit"))
        told = (
            f"{side} {kind.replace('_', ' ')} of {channel} [{unit}]"
            for side, kind, channel, unit in zip(*parts, strict=True)
        )
        lines.append(f"{name}: {', '.join(told)}")
    return lines


def dataset_table(datasets: Mapping[str, DatasetDescription]) -> TerminalTable:
    """Lays out what an artifact holds."""
    from robid.report.terminal_table import Column, TerminalTable

    columns = (
        *(Column("dataset", numbers=False), Column("shape"), Column("type", numbers=False, leaves=1)),
        *(Column("units", numbers=False, leaves=3), Column("axes", numbers=False, leaves=2)),
        Column("what", numbers=False),
    )
    table = TerminalTable(columns, elsewhere="in `--json`")
    for name, row in datasets.items():
        shape = " x ".join(map(str, row.shape))
        table.add(name, shape, row.dtype, row.units, ", ".join(row.axes), row.description)
    return table


def section_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], elsewhere: str) -> TerminalTable:
    """Lays out a table of a page, its first column naming the row; where there is no room, the last columns go first.

    Cells that are long are sentences, others numbers.
    """
    from robid.report.terminal_table import Column, TerminalTable

    longest = [max((len(row[place]) for row in rows), default=0) for place in range(len(columns))]
    heads = (
        Column(head, numbers=place > 0 and longest[place] <= _NUMBERS, leaves=place and len(columns) - place)
        for place, head in enumerate(columns)
    )
    table = TerminalTable([*heads], title, elsewhere)
    for row in rows:
        table.add(*row)
    return table

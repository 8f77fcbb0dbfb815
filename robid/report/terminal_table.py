"""Tables in a terminal: where there is no room whole columns are left out and named, so that no number is ever cut."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.cells import cell_len, chop_cells
from rich.console import Console, ConsoleOptions
from rich.text import Text

from robid.printable import printable
from robid.report.wrapping import wrap

_GAP = 2  # columns between two columns
_HANGING = 2  # columns by which what follows in a cell is indented
_SENTENCE = 18  # words keep so many columns as long as a column can be left out for them
_NARROW = 10  # and so many in need
_PART = re.compile(r"[^\W_]+[\W_]*|[\W_]+")  # what a long name is parted into: `axis_`, `12.`, `stiffness`


@dataclass(frozen=True)
class Column:
    """A column of a table; the first one names the row."""

    head: str  # its head
    numbers: bool = True  # whether it holds numbers, which stand to the right and never wrap; else words, which may
    # When it is left out where there is no room: 1 first, then 2, ...; 0 never. Columns of one head leave together.
    leaves: int = 0
    note: str = ""  # what there is to say below the table as long as it is shown


@dataclass(frozen=True)
class _Extent:
    """How wide a column may be."""

    full: int  # with nothing wrapped
    usual: int  # with its head wrapped, and sentences
    least: int  # with names wrapped
    leaves: int  # when it is left out


class TerminalTable:
    """A table that a terminal of any width shows, and that a pipe gets whole.

    To fit, heads and sentences wrap first; then columns are left out, and a line below names them; then names wrap. In
    a terminal that is too narrow even so, each row becomes lines of its own.
    """

    def __init__(self, columns: Sequence[Column], title: str = "", elsewhere: str = "") -> None:
        """Begins a table; `elsewhere` says where columns are that are left out, as in `on the page`."""
        self.columns, self.title, self.elsewhere = tuple(columns), title, elsewhere
        self.rows: list[tuple[Text, ...]] = []

    def add(self, *cells: str | Text) -> None:
        """Adds a row; a cell alone stands across all columns, above the rows that follow."""
        texts = (cell if isinstance(cell, Text) else Text(cell) for cell in cells)
        self.rows.append(tuple(Text(printable(text.plain.replace("\n", " "), ""), text.style) for text in texts))

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Yields the lines for the width of a console."""
        room, extents = options.max_width, [self._extent(place) for place in range(len(self.columns))]
        needed = _width([extent.usual for extent in extents])
        kept, widths = _fit(extents, room if options.is_terminal else max(room, needed))
        lines = [Text(line, "italic") for line in folded(self.title, room)] if self.title else []
        if widths:
            lines += _row([Text(column.head, "dim") for column in self.columns], kept, widths, self.columns, below=True)
        for row in self.rows:
            if len(row) < len(self.columns):
                lines += [Text(line, row[0].style) for line in folded(row[0].plain, room)]
            else:
                lines += _row(row, kept, widths, self.columns) if widths else self._apart(row, kept, room)
        if len(kept) < len(self.columns):
            lines.append(Text(wrap(self._left_out(kept, needed), room), "dim"))
        said = [self.columns[place].note for place in kept if self.columns[place].note]
        lines += [Text(wrap(note, room if options.is_terminal else None), "dim") for note in said]
        yield Text("\n", no_wrap=True, overflow="ignore").join(lines)

    def _left_out(self, kept: Sequence[int], needed: int) -> str:
        heads = (column.head.replace("\n", " ") for place, column in enumerate(self.columns) if place not in kept)
        where = f"{self.elsewhere} and " if self.elsewhere else ""
        told = ", ".join(dict.fromkeys(heads))
        return f"left out for want of room: {told}; to be seen {where}in a terminal of {needed} columns"

    def _extent(self, place: int) -> _Extent:
        column = self.columns[place]
        cells = [row[place].plain for row in self.rows if len(row) == len(self.columns)]
        widest = max(map(cell_len, cells), default=0)
        head = max(map(cell_len, column.head.split()), default=0)
        full = max(widest, *map(cell_len, column.head.split("\n")))
        if column.numbers:
            return _Extent(full, max(widest, head), max(widest, head), column.leaves)
        # The space before a name indents it.
        word = max((cell_len(found) for cell in cells for found in re.findall(r"^\s*\S+|\S+", cell)), default=0)
        usual = min(full, max(word, head, _SENTENCE))
        return _Extent(full, usual, min(usual, _NARROW), column.leaves)

    def _apart(self, row: Sequence[Text], kept: Sequence[int], room: int) -> Iterator[Text]:
        """Yields a line for each cell of a row, below its name."""
        yield from (Text(line, row[0].style) for line in folded(row[0].plain, room))
        for place in kept[1:]:
            if row[place].plain:
                told = f"    {self.columns[place].head} {row[place].plain}".replace("\n", " ")
                yield from (Text(line, row[place].style) for line in folded(told, room))


def _fit(extents: Sequence[_Extent], room: int) -> tuple[list[int], list[int]]:
    """Returns which columns are shown, and the width of each; no widths where there is not even room for the least."""
    kept = list(range(len(extents)))
    for level in range(max(extent.leaves for extent in extents) + 1):
        kept = [place for place in kept if not 0 < extents[place].leaves <= level]
        usual = [extents[place].usual for place in kept]
        if _width(usual) <= room:
            return kept, _grown(usual, [extents[place].full for place in kept], room)
    least = [extents[place].least for place in kept]
    usual = [extents[place].usual for place in kept]
    return kept, _grown(least, usual, room) if _width(least) <= room else []


def _width(widths: Sequence[int]) -> int:
    return sum(widths) + _GAP * (len(widths) - 1)


def _grown(widths: Sequence[int], wanted: Sequence[int], room: int) -> list[int]:
    """Gives columns what room is left, first those that want the least more."""
    grown, left = list(widths), room - _width(widths)
    for place in sorted(range(len(grown)), key=lambda place: wanted[place] - grown[place]):
        more = min(wanted[place] - grown[place], left)
        grown[place], left = grown[place] + more, left - more
    return grown


def _row(
    row: Sequence[Text], kept: Sequence[int], widths: Sequence[int], columns: Sequence[Column], *, below: bool = False
) -> list[Text]:
    """Lays out the cells of a row side by side, in as many lines as the longest needs, `below` at the foot of them."""
    cells = []
    for place, width in zip(kept, widths, strict=True):
        hanging = _HANGING if place == 0 and not below else 0
        cells.append([line for part in row[place].plain.split("\n") for line in folded(part, width, hanging)])
    height = max(map(len, cells))
    blanks = [[""] * (height - len(cell)) for cell in cells]
    padded = [blank + cell if below else cell + blank for cell, blank in zip(cells, blanks, strict=True)]
    lines = []
    for number in range(height):
        line = Text()
        for place, width, cell in zip(kept, widths, padded, strict=True):
            space = " " * (width - cell_len(cell[number]))
            before, after = (space, "") if columns[place].numbers else ("", space)
            line.append(before).append(cell[number], row[place].style).append(after + " " * _GAP)
        line.rstrip()
        lines.append(line)
    return lines


def folded(text: str, width: int, hanging: int = _HANGING) -> list[str]:
    """Wraps a text between words, and a word that is too long after its separators, in need anywhere.

    What follows stands to the right of where it begins by what is hanging.
    """
    if cell_len(text) <= width:
        return [text]
    margin = " " * (len(text) - len(text.lstrip()))
    lines, room = [margin], max(width - len(margin) - hanging, 1)
    for word in text.split():
        parts = [word] if cell_len(word) <= room else [cut for part in _PART.findall(word) for cut in _cut(part, room)]
        for number, part in enumerate(parts):
            joined = lines[-1] + (" " if number == 0 and lines[-1].strip() else "") + part
            if cell_len(joined) <= width:
                lines[-1] = joined
            else:
                lines.append(f"{margin}{' ' * hanging}{part}")
    return lines


def _cut(part: str, width: int) -> list[str]:
    return chop_cells(part, width) if cell_len(part) > width else [part]


class Footnotes:
    """Sentences below a table, which wrap as messages do."""

    def __init__(self, sentences: Sequence[str], style: str = "dim") -> None:
        self.sentences, self.style = tuple(sentences), style

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Yields the lines for the width of a console."""
        width = options.max_width if options.is_terminal else None
        for sentence in self.sentences:
            yield Text(wrap(sentence, width), self.style, no_wrap=True, overflow="ignore")

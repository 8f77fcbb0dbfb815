"""Tables of text in any dialect."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Text:
    """How a table of text is written, and whether the mapping says so."""

    delimiter: str = ","
    decimal: str = "."
    header: str = "names"  # names, quoted, commented, none
    preface: str = ""
    units_below: bool = False
    newline: str = "\n"
    encoding: str = "utf-8"
    trailing: bool = False
    stated: bool = False
    quoted_cells: bool = False
    gap: str = "nan"
    again: bool = False
    foot: str = ""

    def write(self, path: Path, columns: dict[str, np.ndarray], units: dict[str, str]) -> dict[str, str]:
        end = self.delimiter if self.trailing else ""
        quoted = self.header == "quoted" or any(self.delimiter in name for name in columns)
        names = [f'"{name}"' if quoted else name for name in columns]
        head = self.delimiter.join(names) + end
        lines = self.preface.splitlines()
        lines += {"none": [], "commented": [f"# {head}"]}.get(self.header, [head])
        if self.units_below:
            lines.append(self.delimiter.join(units.get(name, "-") for name in columns) + end)
        cells = [[self._cell(value) for value in values] for values in columns.values()]
        rows = [self.delimiter.join(row) + end for row in zip(*cells, strict=True)]
        if self.again:  # as where a recorder began anew
            rows[len(rows) // 2 : len(rows) // 2] = lines
        lines += [*rows, *self.foot.splitlines()]
        path.write_bytes((self.newline.join(lines) + self.newline).encode(self.encoding))
        return {name: str(i + 1) if self.header == "none" else name for i, name in enumerate(columns)}

    def _cell(self, value: Any) -> str:
        if isinstance(value, str):
            return f'"{value}"' if self.delimiter in value or self.quoted_cells else value
        text = self.gap if np.isnan(value) else f"{value:.17g}".replace(".", self.decimal)
        return f'"{text}"' if self.quoted_cells else text

    @property
    def dialect(self) -> dict[str, Any]:
        """What the mapping says of it."""
        if not self.stated:
            return {}
        delimiter = {"\t": "tab", "   ": "whitespace"}.get(self.delimiter, self.delimiter)
        found: dict[str, Any] = {"delimiter": delimiter, "decimal": self.decimal, "encoding": self.encoding}
        if self.header != "commented":
            found["header_line"] = 0 if self.header == "none" else len(self.preface.splitlines()) + 1
        return found

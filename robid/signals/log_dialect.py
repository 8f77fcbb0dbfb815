"""How a table of text is written, where that cannot be told from the table itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

LogFormat: TypeAlias = Literal["csv", "mat", "hdf5", "parquet", "mcap", "rosbag", "tdms", "mdf"]
"""The formats of logs that are read; `robid.logs` has a row of its table of formats for each."""


@dataclass(frozen=True)
class Dialect:
    """How a table of text is written; what is not given is told from the table."""

    delimiter: str | None = field(
        default=None,
        metadata={
            "description": "What separates the columns: one character, `tab`, or `whitespace` for any number of spaces"
            " and tabs. Told from the table when not given.",
            "pattern": r"^([^\w\s.+\-]|tab|whitespace)$",
        },
    )
    decimal: Literal[".", ","] | None = field(
        default=None, metadata={"description": "Decimal mark; told from the table when not given."}
    )
    header_line: int | None = field(
        default=None,
        metadata={
            "description": "Line of the column names, counted from 1; 0 where there is none and columns are named by"
            " their numbers, from 1. Told from the table when not given.",
            "ge": 0,
        },
    )
    comments: tuple[str, ...] = field(
        default=("#", "%"), metadata={"description": "What lines begin with that are passed over."}
    )
    encoding: str | None = field(
        default=None,
        metadata={
            "description": "Encoding of the text, as `shift_jis`; what its first bytes say, UTF-8 or else Windows-1252"
            " when not given."
        },
    )

    @property
    def separator(self) -> str | None:
        """The delimiter as a character; a space stands for `whitespace`, None where it is to be told."""
        return {"tab": "\t", "whitespace": " "}.get(self.delimiter or "", self.delimiter)

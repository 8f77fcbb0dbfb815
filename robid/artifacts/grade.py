"""How a grade lies in the artifacts that hold one."""

from __future__ import annotations

from robid.artifacts.mapping import Column

_DOUBT = ("doubt",)
GRADE_COLUMNS = {
    "grade/reasons": Column("1", ("reason",), "What keeps it from a better grade"),
    "grade/causes": Column("1", _DOUBT, "Likely causes, the first to blame first"),
    "grade/messages": Column("1", _DOUBT, "What was seen of each"),
    "grade/decisive": Column("1", _DOUBT, "Whether nothing that follows from the data may be used while it stands"),
    "grade/strength": Column("1", _DOUBT, "How far each is beyond what is normal"),
}

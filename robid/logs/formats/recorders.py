"""The recorders whose tables of text have a head that says more than names: told by what it says."""

from __future__ import annotations

from collections.abc import Sequence

from robid.logs.formats.layout import Layout
from robid.logs.formats.lvm import tell_lvm
from robid.logs.formats.twincat import tell_twincat


def tell_recorder(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of a recorder's table by its first lines; None where it is of none that is known."""
    return tell_lvm(lines) or tell_twincat(lines)

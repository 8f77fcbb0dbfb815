"""Composing YAML within limits: nothing that a file says makes reading it long, large or endless, or calls for a type.

Nodes are counted while they are composed, and once more with all that aliases and merge keys repeat, before anything is
made of them: a page of aliases of aliases stands for more than a memory holds.
"""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.events import AliasEvent
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.parser import Parser
from ruamel.yaml.scanner import Scanner

from robid.errors import SettingsError

MOST_BYTES = 2 << 20
"""Size of a settings file; the largest examples have a hundredth."""
MOST_NODES = 30_000  # keys and values, a second's work; 4,000 configurations of a robot with six axes have 28,000
DEEPEST = 40  # sections within sections; experiments have about ten
_LONGEST_KEY = 200
_MOST_DIGITS = 18  # whole numbers of so many fit 64 bits
_WHOLE = re.compile(rf"[-+]?[0-9]{{1,{_MOST_DIGITS}}}")
_CONTROL = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff]")
_TAG = "tag:yaml.org,2002:"


def compose(path: Path, text: str) -> tuple[YAML, Node | None]:
    """Composes the only document of a text.

    Returns:
        What constructs the values of the node, and the node; None where the text is empty.

    Raises:
        SettingsError: If it is larger or deeper than settings are, has tags, or texts and numbers that cannot be used.
        YAMLError: If it is not YAML.
    """
    yaml = YAML(typ="rt")
    # Nobody asks for comments here, and keeping them takes a third of the time of reading.
    yaml.Scanner, yaml.Parser, yaml.Composer = Scanner, Parser, _Bounded
    yaml.composer.path = path
    node = yaml.compose(text)
    if node is not None:
        _Spelled(path).measure(node)
    return yaml, node


class _Bounded(Composer):
    """A composer that counts its nodes, and refuses tags."""

    path = Path()

    def __init__(self, loader: Any = None) -> None:  # noqa: ANN401
        super().__init__(loader)
        self.warn_double_anchors = False  # an anchor may be set anew, and an alias stands for the last one
        self._nodes = self._level = 0

    def compose_node(self, parent: Any, index: Any) -> Any:  # noqa: ANN401
        """Composes a node and all below it."""
        event = self.parser.peek_event()
        self._nodes, self._level = self._nodes + 1, self._level + 1
        if not isinstance(event, AliasEvent) and event.ctag is not None:
            raise tagged(self.path, event.start_mark.line)
        _check_size(self.path, event.start_mark.line, self._nodes, self._level)
        node = super().compose_node(parent, index)
        self._level -= 1
        return node


class _Spelled:
    """Sizes of nodes with what aliases in them repeat; each node is looked at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._sizes: dict[int, tuple[int, int] | None] = {}  # nodes and levels by node, None while it is looked at
        self._reader = YAML(typ="safe", pure=True)

    def measure(self, node: Node, inside: Node | None = None) -> tuple[int, int]:
        """Returns how many nodes and levels a node stands for."""
        if id(node) in self._sizes:
            known = self._sizes[id(node)]
            if known is None:
                where = f"{self._path}:{(inside or node).start_mark.line + 1}"
                what = "S337 an alias refers to a section that contains it"
                raise SettingsError(what, where=where, remedy="leave it out")
            return known
        self._sizes[id(node)], line = None, node.start_mark.line
        count, levels = 1, 0
        if isinstance(node, ScalarNode):
            self._check_scalar(node)
        for below in _below(node):
            more, deep = self.measure(below, node)
            count, levels = count + more, max(levels, deep)
            _check_size(self._path, line, count, levels + 1)
        if isinstance(node, MappingNode):
            self._check_keys(node)
        self._sizes[id(node)] = count, levels + 1
        return count, levels + 1

    def _check_keys(self, node: MappingNode) -> None:
        for key, _ in node.value:
            if isinstance(key, ScalarNode) and len(key.value) <= _LONGEST_KEY:
                continue
            found = f"has {len(key.value)} characters" if isinstance(key, ScalarNode) else "is a list or a section"
            what, remedy = f"S589 a key {found}, where a name belongs", f"use a text of up to {_LONGEST_KEY} characters"
            raise SettingsError(what, where=f"{self._path}:{key.start_mark.line + 1}", remedy=remedy)

    def _check_scalar(self, node: ScalarNode) -> None:
        where = f"{self._path}:{node.start_mark.line + 1}"
        odd = _CONTROL.search(node.value)
        if odd is not None:
            what = f"S590 a text has the character U+{ord(odd[0]):04X}, which stands for no sign"
            raise SettingsError(what, where=where, remedy="leave it out")
        kind = str(node.tag).removeprefix(_TAG)
        if kind not in ("int", "float", "timestamp") or (kind == "int" and _WHOLE.fullmatch(node.value)):
            return
        try:
            # Longer texts of digits are not read, which takes a time that grows faster than they do.
            value = None if len(node.value) > _LONGEST_KEY else self._reader.constructor.construct_object(node)
        except (ValueError, IndexError) as error:  # what looks like a date or number to YAML, as `2026-13-45`, `0x_`
            date = f"S524 looks like a date, but there is none like it: {error}"
            what = date if kind == "timestamp" else "S594 looks like a number, but is none"
            raise SettingsError(what, where=where, remedy="put it in quotes if it is a text") from error
        if value is None or (kind == "int" and abs(value) >= 10**_MOST_DIGITS):
            what = f"S591 a number has {len(node.value)} characters, more than any number has that can be meant"
            remedy = f"whole numbers have up to {_MOST_DIGITS} digits; put it in quotes if it is a text"
            raise SettingsError(what, where=where, remedy=remedy)


def _below(node: Node) -> Any:  # noqa: ANN401
    if isinstance(node, MappingNode):
        return chain.from_iterable(node.value)
    return node.value if isinstance(node, SequenceNode) else ()


def _check_size(path: Path, line: int, nodes: int, levels: int) -> None:
    if nodes <= MOST_NODES and levels <= DEEPEST:
        return
    deep = f"has sections within sections, more than {DEEPEST} levels deep"
    many = f"has more than {MOST_NODES} keys and values, what aliases repeat counted"
    remedy = "settings are far smaller: name another file, or leave out what repeats itself"
    raise SettingsError(f"S592 {deep if levels > DEEPEST else many}", where=f"{path}:{line + 1}", remedy=remedy)


def tagged(path: Path, line: int) -> SettingsError:
    """Returns what to say of a tag, a set or a binary value."""
    what = "S340 tags, sets and binary values of YAML are not used here"
    remedy = "use plain numbers, texts, lists and sections"
    return SettingsError(what, where=f"{path}:{line + 1}", remedy=remedy)

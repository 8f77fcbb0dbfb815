"""Terms and message codes that a page uses, and what they mean: each is explained on the page itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from importlib import resources
from typing import Any

from markupsafe import Markup, escape
from ruamel.yaml import YAML

from robid.report.charts import BodeMatrix, Heatmap, MovingArms, RatioChart, Skeletons, Waterfall
from robid.report.section import Bars, Figure

_FILES = {"S": "settings", "D": "data", "A": "artifacts", "B": "backends", "F": "causes"}
_CODE = re.compile(r"\b([SDABF]\d{3})\b")
_QUOTED = re.compile(r"`([^`]+)`")
_STRESSED = re.compile(r"(?<!\w)\*([^*]+)\*(?!\w)")
_INCOHERENCE = "1 \N{MINUS SIGN} coherence"  # which the template draws with responses
_DRAWN = (Figure, Bars, Skeletons, MovingArms, Waterfall, RatioChart, Heatmap, BodeMatrix)


@dataclass(frozen=True)
class Term:
    """A term, or the code of a message, that a page explains."""

    anchor: str  # its name in the page's address
    title: str  # what is explained
    means: str  # what it means
    do: str = ""  # what to do about it; empty for a term
    read: str = ""  # page of the documentation that says more; empty for none


class Terms:
    """What of a page is explained on it.

    Args:
        content: All that the page says, as dataclasses and tuples.
    """

    def __init__(self, content: object) -> None:
        texts = set(_texts(content))
        named = {_without_unit(text) for text in texts}
        self._by_name = {name: term for name, term in _terms().items() if name in named}
        codes = sorted({code for text in texts for code in _CODE.findall(text)})
        self._codes = {code: term for code in codes if (term := _message(code)) is not None}

    @property
    def every(self) -> tuple[Term, ...]:
        """All of them, terms in the order of their file, then codes."""
        return tuple(dict.fromkeys([*self._by_name.values(), *self._codes.values()]))

    def label(self, text: str) -> Markup:
        """A label as HTML, a link where it is a term."""
        term = self._by_name.get(_without_unit(text))
        return escape(text) if term is None else Markup('<a class="term" href="#{}">{}</a>').format(term.anchor, text)

    def prose(self, text: str) -> Markup:
        """Prose as HTML: what is quoted as code, codes of messages as links, a number on one line with its per cent."""
        kept = str(escape(text)).replace(" %", "\N{NO-BREAK SPACE}%")
        kept = _STRESSED.sub(r"<em>\1</em>", _QUOTED.sub(r"<code>\1</code>", kept))
        return Markup(_CODE.sub(self._linked, kept))

    def _linked(self, found: re.Match[str]) -> str:
        term = self._codes.get(found[1])
        return found[1] if term is None else f'<a class="term" href="#{term.anchor}">{found[1]}</a>'


def _texts(value: object) -> Iterator[str]:
    """Every text that a page says, figures apart."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple):
        for each in value:
            yield from _texts(each)
    elif isinstance(value, _DRAWN):
        yield value.title
        if isinstance(value, BodeMatrix) and value.quality:
            yield _INCOHERENCE
    elif is_dataclass(value):
        for one in fields(value):
            yield from _texts(getattr(value, one.name))


def _without_unit(text: str) -> str:
    return text.partition(" [")[0]


@cache
def _terms() -> dict[str, Term]:
    """Terms by each of their labels."""
    found: dict[str, Term] = {}
    for key, entry in _read("terms").items():
        term = Term(f"term-{key}", entry["names"][0], entry["means"], read=entry["read"])
        found |= dict.fromkeys(entry["names"], term)
    return found


def _message(code: str) -> Term | None:
    entry = _read(_FILES[code[0]]).get(code)
    return None if entry is None else Term(f"message-{code}", code, entry["means"], do=entry["do"])


@cache
def _read(name: str) -> dict[str, Any]:
    text = resources.files("robid").joinpath("explanations", f"{name}.yaml").read_text("utf-8")
    found: dict[str, Any] = YAML(typ="safe").load(text)
    return found

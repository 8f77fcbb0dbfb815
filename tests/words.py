"""Sentences of the documentation and texts of the code, for the rules of plain technical English.

`.venv/bin/python tests/words.py [FILE...]` shows long sentences and retired words.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
LONGEST = 30  # words of a sentence
_LIST = "\n## Retired words\n"
_CODE = re.compile(r"^```.*?^```$|<!--.*?-->|^---$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_END = re.compile(r"(?<=[.!?])[)\"*_]*\s+(?=[\"(*_`]*[A-Z`0-9])")
_OF_THE_FIELD = re.compile(r"held at rest|input holds|held[- ]out|held back", re.IGNORECASE)  # joints, signals, data
_RETIRED = re.compile(r"^\| `?(.+?)`? \|", re.MULTILINE)


def documents() -> list[Path]:
    """Pages that people read."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs/tutorials").glob("*.py"))]


def prose(path: Path) -> str:
    """A page without its code, or the text cells of a notebook."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        cells = re.findall(r"^# %% \[markdown\]\n((?:#.*\n)+)", text, re.MULTILINE)
        text = "\n\n".join(re.sub(r"^# ?", "", cell, flags=re.MULTILINE) for cell in cells)
    return _CODE.sub("", text).partition(_LIST)[0]


def sentences(text: str) -> Iterator[str]:
    """Sentences of paragraphs, list items and cells of tables; headings and code are none, code in a line is a word."""
    flat = re.sub(r"`[^`]*`", "`code`", _LINK.sub(r"\1", text))
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:[-*|>]|\d+\.) ?)|\|", re.sub(r"^#.*$", "", flat, flags=re.MULTILINE))
    for block in blocks:
        yield from (found for one in _END.split(" ".join(block.split())) if (found := one.strip("-*> ")))


def words(sentence: str) -> int:
    """How many words a sentence has; what is no letter, digit or code is none."""
    return sum(any(sign.isalnum() for sign in word) for word in sentence.split())


def long_sentences(path: Path) -> tuple[list[str], int]:
    """Sentences that are too long, and how many there are."""
    every = [one for one in sentences(prose(path)) if words(one) > 2]
    return [one for one in every if words(one) > LONGEST], len(every)


def retired() -> list[re.Pattern[str]]:
    """Words that the glossary lists as retired."""
    text = (ROOT / "docs/concepts/glossary.md").read_text(encoding="utf-8").partition(_LIST)[2]
    found = [name for name in _RETIRED.findall(text) if name not in ("retired", "---")]
    return [re.compile(rf"\b{re.escape(name)}\b", re.IGNORECASE) for name in found]


def shown_texts() -> Iterator[tuple[str, str]]:
    """Texts of two words and more that the package may show, with their places; docstrings are none."""
    for path in sorted((ROOT / "robid").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        told = {id(node.body[0].value) for node in ast.walk(tree) if _has_docstring(node)}
        for node in ast.walk(tree):
            is_text = isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told
            if is_text and " " in node.value.strip():
                yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value
    for path in sorted((ROOT / "robid/explanations").glob("*.yaml")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            yield f"{path.relative_to(ROOT)}:{number}", line


def _has_docstring(node: ast.AST) -> bool:
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return isinstance(node, kinds) and ast.get_docstring(node) is not None


def uses(text: str) -> list[str]:
    """Retired words that a text has, code and targets of links left out."""
    plain = _OF_THE_FIELD.sub("", re.sub(r"`[^`]*`", "", _LINK.sub(r"\1", text)))
    return [match[0] for pattern in retired() for match in pattern.finditer(plain)]


def report(pages: list[Path], *, whole: bool) -> Iterator[str]:
    """Yields a line for each page, with its long sentences where they are asked for, and the share of all."""
    counts = [0, 0]
    for page in pages:
        found, count = long_sentences(page)
        counts = [counts[0] + len(found), counts[1] + count]
        yield f"{page.relative_to(ROOT)}: {len(found)} of {count} over {LONGEST} words; retired: {uses(prose(page))}"
        yield from (f"  {words(one)}: {one}" for one in found if whole)
    yield f"{counts[0]} of {counts[1]}: {counts[0] / max(counts[1], 1):.1%}"


if __name__ == "__main__":
    named = [Path(name).resolve() for name in sys.argv[1:]]
    sys.stdout.write("\n".join(report(named or documents(), whole=bool(named))) + "\n")

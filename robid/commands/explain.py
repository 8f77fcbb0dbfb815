"""Saying what the code of a message means, why it stands and what to do; the texts lie in `robid/explanations/`."""

from __future__ import annotations

import difflib
import re
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from ruamel.yaml import YAML

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.errors import SettingsError

_FOLDER = Path(__file__).parents[1] / "explanations"
_HEADING = re.compile(r"^([SDABF]\d{3}):$", re.MULTILINE)
_WIDEST = 100
_NEAR = 3


@dataclass(frozen=True)
class Letter:
    """What the codes with one letter have in common."""

    kind: Annotated[str, Meaning("Name of the kind of message.")]
    exit_code: Annotated[int, Meaning("What a command exits with that ends with such a message.")]
    about: Annotated[str, Meaning("What is wrong, in a phrase.")]
    file: Annotated[str, Meaning("Where its explanations lie, in the package.")]


LETTERS = {
    "S": Letter("settings", 2, "the experiment or robot file, or the command line", "settings.yaml"),
    "D": Letter("data", 4, "measured or simulated data", "data.yaml"),
    "A": Letter("artifact", 3, "a file that robid has written, or is to write", "artifacts.yaml"),
    "B": Letter("backend", 3, "what computes: processes, schedulers, workers", "backends.yaml"),
    "F": Letter(
        "cause of a finding", 5, "what speaks against a result, where its grade is *do not use*", "causes.yaml"
    ),
}


GRADES = {"trust": 0, "predicts": 0, "do not use": 5}
"""Grades of a fit, the best first, with what a command exits with."""
_ALL_GRADES = "grades"
_GRADE_FILE = "grades.yaml"


@dataclass(frozen=True)
class Explanation:
    """What there is to say of a code."""

    code: Annotated[str, Meaning("The code, or the grade.")]
    kind: Annotated[str, Meaning("Kind of message, that of its letter; `grade` for a grade.")]
    exit_code: Annotated[int, Meaning("What a command exits with that ends with it.")]
    means: Annotated[str, Meaning("What was found.")]
    why: Annotated[str, Meaning("What would go wrong.")]
    do: Annotated[str, Meaning("What to do.")]


@dataclass(frozen=True)
class ExplainAnswer(Answer, type="explain"):
    """What codes of messages mean."""

    explanations: Annotated[tuple[Explanation, ...], Meaning("One for each code, in the order asked for.")]


@dataclass(frozen=True)
class LettersAnswer(Answer, type="explain-letters"):
    """What the letters of codes stand for, where no code is given."""

    letters: Annotated[dict[str, Letter], Meaning("Kinds of messages, by letter.")]


def explain(codes: Sequence[str], *, as_json: bool) -> int:
    """Prints what codes and grades mean, or without any what their letters stand for; returns the exit code.

    Raises:
        SettingsError: If there is no such code or grade.
    """
    if not codes:
        _print_letters(as_json=as_json)
        return 0
    names = list(dict.fromkeys(_names(codes)))
    grades = read_grades() if GRADES.keys() & names else {}
    texts = {letter: read_texts(letter) for letter in sorted({name[:1] for name in names} & LETTERS.keys())}
    unknown = [name for name in names if name not in grades and f"\n{name}:\n" not in texts.get(name[:1], "")]
    if unknown:
        remedy = f"take it from the message, as in `S007`; {_near(unknown[0])}"
        raise SettingsError(f"S530 no message has the code {', '.join(unknown)}", where="explain", remedy=remedy)
    found = [grades[name] if name in grades else explanation(name, texts[name[0]]) for name in names]
    if as_json:
        print_json(ExplainAnswer(tuple(found)))
    else:
        typer.echo("\n\n".join(map(_shown, found)))
    return 0


def _names(words: Sequence[str]) -> Iterator[str]:
    """Codes and grades of what was asked: a grade may stand in one word or in several, and `grades` are all."""
    joined = re.sub(r"do\s+not\s+use", "do not use", "\n".join(words), flags=re.IGNORECASE)
    for word in (each.strip() for each in joined.split("\n")):
        grade = word.lower()
        yield from GRADES if grade == _ALL_GRADES else (grade,) if grade in GRADES else (word.upper(),)


def read_grades() -> dict[str, Explanation]:
    """What is said of the grades."""
    entries = YAML(typ="safe", pure=True).load((_FOLDER / _GRADE_FILE).read_text(encoding="utf-8"))
    return {name: Explanation(name, "grade", GRADES[name], **entry) for name, entry in entries.items()}


def read_texts(letter: str) -> str:
    """The file with the explanations of a letter."""
    return "\n" + (_FOLDER / LETTERS[letter].file).read_text(encoding="utf-8")


def codes_explained(text: str) -> list[str]:
    """Codes that a file explains, in its order."""
    return _HEADING.findall(text)


def explanation(code: str, text: str) -> Explanation:
    """What a file says of one of its codes; to read the whole file as YAML takes a second."""
    begin = text.index(f"\n{code}:\n") + 1
    end = _HEADING.search(text, begin + 1)
    entry = YAML(typ="safe", pure=True).load(text[begin : end.start() if end else None])[code]
    letter = LETTERS[code[0]]
    return Explanation(code, letter.kind, letter.exit_code, **{key: " ".join(entry[key].split()) for key in entry})


def _near(code: str) -> str:
    """Codes that look like it."""
    known = [each for letter in LETTERS for each in codes_explained(read_texts(letter))]
    close = difflib.get_close_matches(code, known, n=_NEAR, cutoff=0.5)
    if close:
        return f"near ones: {', '.join(close)}"
    return "`robid explain` lists the letters, `robid explain grades` the grades"


def _print_letters(*, as_json: bool) -> None:
    if as_json:
        print_json(LettersAnswer(LETTERS))
        return
    rows = [f"{key}  {one.kind} (exit code {one.exit_code}): {one.about}" for key, one in LETTERS.items()]
    first = "`robid explain CODE` explains a message, `robid explain grades` the grades."
    typer.echo("\n".join([*wrapped(first), *(line for row in rows for line in wrapped(row, "   "))]))


def wrapped(text: str, hanging: str = "") -> list[str]:
    """Lines of a text as wide as the terminal, but no wider than is read with ease."""
    width = max(min(_WIDEST, shutil.get_terminal_size().columns), 20)
    return textwrap.wrap(text, width, subsequent_indent=hanging)


def _shown(one: Explanation) -> str:
    width = min(_WIDEST, shutil.get_terminal_size().columns)
    strict = ", with `--strict` 5" if one.code == "predicts" else ""
    lines = wrapped(f"{one.code}  {one.kind}, exit code {one.exit_code}{strict}", "  ")
    for name in ("means", "why", "do"):
        head = f"  {name + ':':<7}"
        shown = textwrap.wrap(
            getattr(one, name), max(width, 20), initial_indent=head, subsequent_indent=" " * len(head)
        )
        lines += shown
    return "\n".join(lines)

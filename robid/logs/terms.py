"""Channels that are weighted sums of variables, as a mapping writes them: `q2 + q3`, `0.5*a - 2*b`, `(a + b)/2`."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.\[(])")
_INDEX = re.compile(r"\(\s*[\d:]+\s*(?:,\s*[\d:]+\s*)*\)|\{\d+\}|\[[^\]]*\]")
_QUOTED = re.compile(r"`([^`]+)`|\"([^\"]+)\"|'([^']+)'")
_WORD = re.compile(r"[^\s+*/()`\"'-]+")
_OPERATORS = re.compile(r"[-+*/`\"']")
_DEEPEST = 20


class NoSumError(Exception):
    """Why a text is no weighted sum of variables."""


@dataclass(frozen=True)
class Sum:
    """A weighted sum.

    Attributes:
        weights: Weight of each variable by its name.
        constant: What is added.
    """

    weights: dict[str, float] = field(default_factory=dict)
    constant: float = 0.0

    def __add__(self, other: Sum) -> Sum:
        names = dict.fromkeys([*self.weights, *other.weights])
        weights = {name: self.weights.get(name, 0.0) + other.weights.get(name, 0.0) for name in names}
        return Sum(weights, self.constant + other.constant)

    def times(self, factor: float) -> Sum:
        """The sum, scaled."""
        return Sum({name: weight * factor for name, weight in self.weights.items()}, self.constant * factor)


def may_be_sum(text: str) -> bool:
    """Whether a name that no variable has could be a sum."""
    return bool(_OPERATORS.search(text))


def parse_sum(text: str, known: Collection[str]) -> Sum:
    """Reads a weighted sum of variables.

    A name is the longest of the log's that stands there, whatever it is made of; one in quotes is taken as it is. A
    number is a weight, unless it is a column's, has no factor but numbers, and is the last of them.

    Args:
        text: The sum.
        known: The variables that the log has.

    Raises:
        NoSumError: If it is none.
    """
    reader = _Reader(text, sorted({form for name in known for form in (name, name.removeprefix("/"))}, key=len)[::-1])
    found = reader.sum(0)
    reader.skip()
    if reader.at < len(text):
        raise NoSumError(f"at `{text[reader.at :]}` it is no sum of variables")
    if found.constant:
        raise NoSumError(
            f"it adds the number {found.constant:g}, which is no variable: an output's offset is its `zero`"
        )
    weights = {name: weight for name, weight in found.weights.items() if weight}
    if not weights:
        raise NoSumError("nothing is left of its variables")
    return Sum(weights)


class _Reader:
    """Reads a sum from left to right."""

    def __init__(self, text: str, known: list[str]) -> None:
        self.text, self.known, self.at = text, known, 0

    def skip(self) -> None:
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1

    def take(self, marks: str) -> str:
        """The next mark if it is one of some; nothing else."""
        self.skip()
        if self.at < len(self.text) and self.text[self.at] in marks:
            self.at += 1
            return self.text[self.at - 1]
        return ""

    def sum(self, depth: int) -> Sum:
        """Terms with signs between them."""
        if depth > _DEEPEST:
            raise NoSumError("its brackets are too deep")
        sign = -1.0 if self.take("+-") == "-" else 1.0
        found = self.product(depth).times(sign)
        while mark := self.take("+-"):
            found += self.product(depth).times(-1.0 if mark == "-" else 1.0)
        return found

    def product(self, depth: int) -> Sum:
        """A variable or a sum in brackets with its weights."""
        factors = [self.factor(depth)]
        divisors: list[float] = []
        while mark := self.take("*/"):
            factor = self.factor(depth)
            if mark == "*":
                factors.append(factor)
            elif isinstance(factor, float):
                divisors.append(factor)
            else:
                raise NoSumError("it divides by a variable")
        sums = [one for one in factors if not isinstance(one, float)]
        numbers = [one for one in factors if isinstance(one, float)]
        if len(sums) > 1:
            raise NoSumError("it multiplies variables")
        found = sums[0] if sums else self._column(numbers)
        for number in numbers:
            found = found.times(number)
        for divisor in divisors:
            if divisor == 0:
                raise NoSumError("it divides by zero")
            found = found.times(1 / divisor)
        return found

    def _column(self, numbers: list[float]) -> Sum:
        """The column that the last of some numbers names, in tables without names; else a constant."""
        name = f"{numbers[-1]:g}"
        if name in self.known:
            numbers.pop()
            return Sum({name: 1.0})
        return Sum({}, 1.0)

    def factor(self, depth: int) -> Sum | float:
        """A number, a variable or a sum in brackets."""
        self.skip()
        rest = self.text[self.at :]
        if quoted := _QUOTED.match(rest):
            self.at += quoted.end()
            return Sum({next(one for one in quoted.groups() if one is not None): 1.0})
        number = _NUMBER.match(rest)
        name = next((one for one in self.known if self._stands(rest, one)), None)
        if number and (name is None or len(name) <= number.end()):
            self.at += number.end()
            return float(number[0])
        if name is not None:
            index = _INDEX.match(rest, len(name))
            length = index.end() if index else len(name)
            self.at += length
            return Sum({rest[:length]: 1.0})
        if rest.startswith("("):
            self.at += 1
            found = self.sum(depth + 1)
            if not self.take(")"):
                raise NoSumError("a bracket is open at its end")
            return found
        if rest.startswith(("-", "+")):
            self.at += 1
            sign, factor = -1.0 if rest[0] == "-" else 1.0, self.factor(depth)
            return factor * sign if isinstance(factor, float) else factor.times(sign)
        word = _WORD.match(rest)
        raise UnknownNameError(word[0]) if word else NoSumError("a variable is missing in it")

    def _stands(self, rest: str, name: str) -> bool:
        """Whether a name stands at the beginning of a text, and not only as the beginning of a longer word."""
        if not rest.startswith(name):
            return False
        after = rest[len(name) : len(name) + 1]
        return not (after.isalnum() or after in ("_", ".")) or not (name[-1].isalnum() or name[-1] == "_")


class UnknownNameError(NoSumError):
    """A variable of a sum that the log does not have."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the log has no variable `{name}`")
        self.name = name

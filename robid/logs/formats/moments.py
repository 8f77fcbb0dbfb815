"""Reads moments, as recorders and spreadsheets write dates and times of day, a whole column of text at once."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray, IntArray

_SECOND = 1_000_000_000
_HOUR, _DAY = 3600 * _SECOND, 86400 * _SECOND
_ABSENT = np.iinfo(np.int64).min
_LONGEST = 80  # characters of a moment at most
_DIGITS = 9  # digits of a second's fraction that are kept
_MONTHS = (
    "jan gen ene|feb fév fev|mar mär mrz|apr abr avr|may mai mag|jun juin giu|jul juil lug|aug ago aoû aou"
    "|sep set|oct okt ott|nov|dec dez dic déc"
)
_MONTH = {name: index for index, names in enumerate(_MONTHS.split("|"), start=1) for name in names.split()}
_ZONES = {
    **{"CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "WEST": 1, "BST": 1, "EET": 2, "EEST": 3},
    **{"EST": -5, "EDT": -4, "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7},
}
"""Hours ahead of universal time of zones whose name changes with the season; for others one column has one."""

_WORD = r"[^\W\d_]"
_DATES = (
    r"(?P<y>\d{4})(?P<s>[-/.:])(?P<m>\d{1,2})(?P=s)(?P<d>\d{1,2})",
    r"(?P<y>\d{4})(?P<m>\d\d)(?P<d>\d\d)",
    r"(?P<a>\d{1,2})(?P<s>[-/]|\.\s?)(?P<b>\d{1,2})(?P=s)(?P<c>\d{4}|\d\d)",
    rf"(?P<d>\d{{1,2}})(?:[-/ ]|\.\s?)(?P<month>{_WORD}{{3,12}})(?:[-/ ]|[.,]\s?)(?P<y>\d{{4}}|\d\d)",
    rf"(?P<y>\d{{4}})[-/ ](?P<month>{_WORD}{{3,12}})[-/ ](?P<d>\d{{1,2}})",
    rf"(?P<month>{_WORD}{{3,12}})[.]?[-/ ]\s?(?P<d>\d{{1,2}})(?:(?:st|nd|rd|th)?,?[-/ ]\s?(?P<y>\d{{4}}))?",
)
_ZONE = r"(?:\s?(?P<zone>[A-Z]{1,5}))?(?:\s?(?P<ahead>[-+])(?P<zh>\d\d):?(?P<zm>\d\d)?)?"
_HALF = r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\.?)?"
_CLOCK = r"(?P<H>\d{1,3}):(?P<M>\d{1,2}):(?P<S>\d{1,2})(?:(?P<p>[.,:])(?P<f>\d+))?"
_CLOCKS = (
    rf"{_CLOCK}{_HALF}{_ZONE}",
    rf"(?P<H>\d{{1,2}}):(?P<M>\d\d){_HALF}{_ZONE}",
    r"(?P<M>\d{1,3}):(?P<S>\d\d)[.,](?P<f>\d+)",
)
_WITHIN = (
    *_CLOCKS[:2],
    rf"(?P<H>\d\d)(?P<M>\d\d)(?P<S>\d\d)(?:[.,](?P<f>\d+))?{_ZONE}",
    rf"(?P<H>\d\d)(?P<q>[-_.])(?P<M>\d\d)(?P=q)(?P<S>\d\d)(?:[-_.,](?P<f>\d+))?{_ZONE}",
)
"""Times of day that stand beside a date."""

_BETWEEN = r"(?:[T_:]|\s*[-/]\s*|,?\s+)"
_WEEKDAY = rf"(?:{_WORD}{{2,12}}[.,]{{0,2}}\s+)?"
_WORDS = ("month", "half", "zone", "ahead", "p", "s", "q")  # groups that are no numbers
_FORMS = tuple(
    re.compile(text)
    for text in (
        *(f"{_WEEKDAY}{day}{_BETWEEN}{time}" for day in _DATES for time in _WITHIN),
        *(f"{time}{_BETWEEN}{day}" for day in _DATES for time in _CLOCKS[:2]),
        rf"{_WEEKDAY}(?P<month>{_WORD}{{3,12}})\s+(?P<d>\d{{1,2}})\s+{_CLOCK}\s+{_ZONE}\s?(?P<y>\d{{4}})",
        rf"(?P<days>\d+)(?:\s?days?,?\s|\.){_CLOCK}",
        *_CLOCKS,
        *(f"{_WEEKDAY}{day}" for day in _DATES),
    )
)


@dataclass(frozen=True)
class _Form:
    """Where a kind of cell, told by all that is no digit, has its numbers; and what its words say."""

    spans: dict[str, tuple[int, int]]
    words: dict[str, str]

    @property
    def kind(self) -> str:
        """What the moments of one column have in common."""
        if "a" in self.spans:
            return "numbers"
        if "d" in self.spans:
            return "date"
        return "minutes" if "H" not in self.spans else "clock"


@lru_cache(maxsize=4096)
def _form(shape: str) -> _Form | None:
    """The form of cells whose digits are zeros; None where it is no moment."""
    for pattern in _FORMS:
        match = pattern.fullmatch(shape)
        if match is None:
            continue
        parts = {name: span for name in pattern.groupindex if (span := match.span(name)) != (-1, -1)}
        words = {name: shape[slice(*parts.pop(name))] for name in _WORDS if name in parts}
        if "month" not in words or _month(words["month"]):
            return _Form(parts, words)
    return None


def _month(word: str) -> int:
    """The number of a month by its name, in English or a neighbouring language; 0 for another word."""
    name = word.lower()
    return next((_MONTH[name[:length]] for length in (4, 3) if name[:length] in _MONTH), 0)


_EPOCH = date(1970, 1, 1).toordinal()


def origin_of(start: tuple[int, int], *, dated: bool) -> tuple[str, int]:
    """What a moment, day and time of day [ns], counts from, `1970` or `midnight`, and the nanoseconds since then."""
    day, instant = start
    return ("1970", (day - _EPOCH) * _DAY + instant) if dated else ("midnight", instant)


def is_moment(cell: str) -> bool:
    """Whether a text is a date, a time of day, or both."""
    moments = Moments()
    return bool(cell) and moments.add([cell]) is None and moments.first_wrong() is None


@dataclass
class Moments:
    """A column of moments, added in parts."""

    # What its cells have in common: a `date` whose parts are known, one of three `numbers` in an order that only all of
    # them tell, a `clock` without a date, or `minutes` and seconds
    kind: str = ""
    marks: str = ""  # What stands between the numbers of its dates
    halved: bool = False  # Whether hours count to twelve
    _dates: list[IntArray] = field(default_factory=list)
    _clocks: list[IntArray] = field(default_factory=list)

    def add(self, cells: Sequence[str]) -> int | None:
        """Adds cells, empty where they are missing; returns the place of one that is no moment."""
        if long := next((place for place, cell in enumerate(cells, start=1) if len(cell) > _LONGEST), 0):
            return long - 1
        dates, clocks = np.zeros(len(cells), np.int64), np.full(len(cells), _ABSENT)
        text = np.array(cells) if len(cells) else np.zeros(0, "U1")
        codes = np.ascontiguousarray(text).view(np.uint32).reshape(len(cells), -1)
        shapes = np.where((codes >= ord("0")) & (codes <= ord("9")), ord("0"), codes)
        left = np.flatnonzero(text != "")
        while len(left):
            alike = np.all(shapes[left] == shapes[left[0]], axis=1)
            form = _form("".join(map(chr, shapes[left[0]])).rstrip("\0"))
            if form is None or not self._agrees(form):
                return int(left[0])
            places = left[alike]
            numbers = {name: _number(codes[places], *span) for name, span in form.spans.items() if name != "f"}
            clocks[places], wrong = _clock(form, numbers, codes[places])
            if len(wrong):
                return int(places[wrong[0]])
            dates[places] = _date(form, numbers)
            left = left[~alike]
        self._dates.append(dates)
        self._clocks.append(clocks)
        return None

    def _agrees(self, form: _Form) -> bool:
        """Whether cells of a form belong to the column; the first ones say what it holds."""
        kinds = {self.kind or form.kind, form.kind}
        # Of a time that passed the hours are told only once there are some.
        self.kind = "clock" if kinds == {"clock", "minutes"} else self.kind or form.kind
        self.marks = self.marks or form.words.get("s", "").strip()
        self.halved = self.halved or "half" in form.words
        return len(kinds) == 1 or kinds == {"clock", "minutes"}

    def first_wrong(self) -> int | None:
        """The place of a cell that is no date in any order of its numbers."""
        dates, clocks = self._joined()
        if self.kind not in ("date", "numbers") or self._days(dates[clocks != _ABSENT]) is not None:
            return None
        present = np.flatnonzero(clocks != _ABSENT)
        for place in present[np.unique(dates[present], return_index=True)[1]]:
            if self._days(dates[[place]]) is None:
                return int(place)
        return int(present[0])

    def start(self) -> tuple[int, int] | None:
        """Day, none without dates, and time of day of the first moment [ns]; None where there is no moment."""
        days, time = self._instants()
        return (int(days[0]), int(time[0])) if len(time) else None

    def seconds(self, start: tuple[int, int] | None = None) -> FloatArray:
        """Seconds since a moment, as `start` has it, the first one where none is told; NaN where one is missing."""
        _, clocks = self._joined()
        days, time = self._instants()
        day, instant = start or self.start() or (0, 0)
        found = np.full(len(clocks), np.nan)
        found[clocks != _ABSENT] = ((days - day) * _DAY + (time - instant)) / _SECOND
        return found

    def _instants(self) -> tuple[IntArray, IntArray]:
        """Day and time of day of each moment that there is [ns]; the day is 0 where there are no dates."""
        dates, clocks = self._joined()
        present = clocks != _ABSENT
        dates, time = dates[present], clocks[present]
        if self.kind in ("date", "numbers"):
            days = self._days(dates)
            return (np.zeros(len(time), np.int64) if days is None else days), time
        return np.zeros(len(time), np.int64), _without_wraps(time + dates * _DAY, self._turn(time))

    def _joined(self) -> tuple[IntArray, IntArray]:
        none = np.zeros(0, np.int64)
        return np.concatenate([none, *self._dates]), np.concatenate([none, *self._clocks])

    def _turn(self, time: IntArray) -> int:
        """After how long a time without a date begins again."""
        if self.kind == "minutes":
            return _HOUR
        hours = np.unique(time // _HOUR)
        counts_to_twelve = len(hours) > 1 and hours.min() > 0 and hours.max() == 12
        return _DAY // 2 if counts_to_twelve and not self.halved else _DAY

    def _days(self, dates: IntArray) -> IntArray | None:
        """Days since the year 1; None where some date exists in no order of its numbers.

        Of several orders the one in which dates follow each other most closely is meant: a log goes on from one day
        to the next. Within one day it makes no difference.
        """
        changes = np.concatenate([[0], np.flatnonzero(np.diff(dates)) + 1]) if len(dates) else np.zeros(0, int)
        followed, best = dates[changes].tolist(), None
        for place, order in enumerate(self._orders(dates)):
            known = {code: _ordinal(code, order) for code in set(followed)}
            if None in known.values():
                continue
            days = [known[code] or 0 for code in followed]
            steps = [after - before for before, after in pairwise(days)]
            score = (sum(step < 0 for step in steps), sum(map(abs, steps)), place)
            if best is None or score < best[0]:
                best = score, np.array(days, np.int64)
        if best is None:
            return None if followed else dates
        return np.repeat(best[1], np.diff([*changes, len(dates)]))

    def _orders(self, dates: IntArray) -> tuple[str, ...]:
        """Orders that the numbers of a date may have, the usual one first."""
        if self.kind == "date":
            return ("ymd",)
        first = ("mdy", "dmy") if self.halved and self.marks == "/" else ("dmy", "mdy")
        return first if np.any(dates % 10000 >= 100) else (*first, "ymd")


def _number(codes: NDArray[np.uint32], begin: int, end: int) -> IntArray:
    powers = 10 ** np.arange(end - begin - 1, -1, -1, dtype=np.int64)
    return np.asarray((codes[:, begin:end].astype(np.int64) - ord("0")) @ powers)


def _clock(form: _Form, numbers: dict[str, IntArray], codes: NDArray[np.uint32]) -> tuple[IntArray, IntArray]:
    """Nanoseconds since the day began, in universal time where a zone is stated; and cells that are no times."""
    none = np.zeros(len(codes), np.int64)
    hours, minutes, seconds = (numbers.get(name, none) for name in "HMS")
    wrong = (seconds > 60) | ((minutes > 59) & ("H" in form.spans))
    if form.kind in ("date", "numbers"):
        wrong |= hours > 24
    if "half" in form.words:
        wrong |= (hours > 12) | (hours < 1)
        hours = hours % 12 + 12 * (form.words["half"] in "Pp")
    time = hours * _HOUR + (minutes * 60 + seconds) * _SECOND
    if "f" in form.spans:
        begin, end = form.spans["f"]
        # Behind a colon stand milliseconds, also without zeros before them.
        digits = 3 if form.words.get("p") == ":" and end - begin < 3 else min(end - begin, _DIGITS)
        time += _number(codes, begin, min(end, begin + _DIGITS)) * 10 ** (_DIGITS - digits)
    ahead = numbers.get("zh", none) * 60 + numbers.get("zm", none)
    time -= ahead * 60 * _SECOND * (-1 if form.words.get("ahead") == "-" else 1)
    time -= _ZONES.get(form.words.get("zone", ""), 0) * _HOUR
    return time, np.flatnonzero(wrong)


def _date(form: _Form, numbers: dict[str, IntArray]) -> IntArray:
    """The numbers of a date in one: the first two times 1e6 and 1e4, or year, month and day; or days that passed."""
    if form.kind in ("clock", "minutes"):
        return numbers.get("days", np.zeros(1, np.int64))
    if form.kind == "numbers":
        return numbers["a"] * 1_000_000 + numbers["b"] * 10_000 + numbers["c"]
    year = numbers.get("y", np.array([2000]))
    month = numbers.get("m", np.array([_month(form.words.get("month", ""))]))
    return np.asarray(year * 1_000_000 + month * 10_000 + numbers["d"])


def _ordinal(code: int, order: str) -> int | None:
    """The day that the three numbers of a date are in an order; None where there is none such."""
    # In a date of known parts the year comes first and may have four digits.
    three = (code // 1_000_000, code // 10_000 % 100, code % 10_000)
    told = dict(zip(order, three, strict=True))
    year = told["y"] + (0 if told["y"] > 99 else 2000)
    try:
        return date(year, told["m"], told["d"]).toordinal()
    except ValueError:
        return None


def _without_wraps(time: IntArray, turn: int) -> IntArray:
    """Times that go on where a clock begins again, as at midnight."""
    steps = np.diff(time)
    turns = np.where(steps < -turn // 2, -(steps // turn), 0)
    return np.asarray(time + turn * np.concatenate([[0], np.cumsum(turns)]), np.int64) if len(time) else time

"""The longest part of a log in which nothing is missing, and the settings that choose it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.mapping import LogMapping
from robid.logs.parts import chosen_part, part_notes, whole_piece
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

MAPPING = LogMapping(
    file=Path("log.csv"),
    sampling_period_s=0.004,
    inputs=(InputChannel("drive", "u"),),
    outputs=(OutputChannel("drive", "q"),),
    one_shot=True,
)
TIMED = replace(MAPPING, time=TimeChannel("t", "ms"))


def followed(mapping, columns):
    """The part that a mapping chooses once the remedy is followed."""
    words = whole_piece(mapping, columns, chosen_part(mapping, columns)).split()
    low, high = float(words[3]), float(words[7].rstrip(":"))
    return chosen_part(replace(mapping, from_s=low, to_s=high), columns)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("mapping", [MAPPING, TIMED])
def test_what_is_named_chooses_the_longest_whole_part(seed, mapping):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(60, 4000))
    kept = np.sort(generator.choice(count, count - 3, replace=False)) if mapping is TIMED else np.arange(count)
    columns = {"u": generator.standard_normal(len(kept)), "q": generator.standard_normal(len(kept))}
    if mapping is TIMED:
        columns["t"] = 1e6 + 4 * kept
    for name in ("u", "q"):
        columns[name][generator.choice(len(kept), 2)] = np.nan
    broken = np.diff(kept) > 1  # by hand: every part, sample by sample
    best, start = (0, 0), 0
    for at in range(len(kept) + 1):
        lost = at < len(kept) and (np.isnan(columns["u"][at]) or np.isnan(columns["q"][at]))
        if at == len(kept) or lost or (at and broken[at - 1]):
            best = max(best, (at - start, start))
            start = at + 1 if lost else at
    part = followed(mapping, columns)
    assert part.stop - part.start == best[0]
    assert np.isfinite(columns["u"][part]).all()
    assert not broken[part.start : part.stop - 1].any()


def test_nothing_is_named_where_nothing_is_missing_or_nothing_is_left():
    columns = {"u": np.arange(50.0), "q": np.arange(50.0)}
    assert whole_piece(MAPPING, columns, slice(None)) == ""
    columns["u"][::3] = np.nan
    assert whole_piece(MAPPING, columns, slice(None)) == ""


def test_a_part_beyond_the_log_is_refused_with_its_length():
    columns = {"u": np.arange(50.0), "q": np.arange(50.0)}
    with pytest.raises(DataError, match=r"lasts 0\.196 s: from 1 s to its end it has 0 samples") as refused:
        chosen_part(replace(MAPPING, from_s=1.0), columns)
    assert "within 0 and 0.196" in refused.value.remedy
    assert chosen_part(replace(MAPPING, from_s=0.1, to_s=0.12), columns) == slice(25, 31)


@pytest.mark.parametrize("to_s", [None, 0.12, 0.196, 0.199, 12.0])
@pytest.mark.parametrize("mapping", [MAPPING, TIMED])
def test_a_log_that_ends_before_its_limit_says_when(mapping, to_s):
    columns = {"u": np.arange(50.0), "q": np.arange(50.0), "t": 700 + 4 * np.arange(50.0)}
    mapping = replace(mapping, from_s=0.1, to_s=to_s)
    (note,) = part_notes(mapping, columns, chosen_part(mapping, columns))
    assert ("its end at 0.196 s, before 12 s" in note) == (to_s == 12.0)
    assert not part_notes(replace(mapping, from_s=0.0, to_s=None), columns, slice(None))

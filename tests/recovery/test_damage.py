"""Damaged artifacts, fleet files and logs: each is read as it was, or refused by name; nothing crashes or hangs.

A log without checksums may lose a sample unseen; the response must then lie within its own uncertainty of the whole
log's: at most 20 % of its elements beyond 3 deviations. A case is known by its seed:
`damage.run_cases(case, folder, range(seed, seed + 1))` runs it again.
"""

from collections import Counter

import pytest

pytest.importorskip("pyarrow")

import damage
from damaged_folders import made_once

SHORT = {"artifact": 45, "log": 15, "response": 25, "settings": 150, "command": 40}
LONG = {"artifact": 1080, "log": 800, "chain": 60, "fleet": 60}
"""Numbers of cases; the long ones are 2,000."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return made_once(tmp_path_factory.mktemp)


def right(case, folder, seeds):
    """Runs cases, which must all come out right, some of them refused; returns how many."""
    outcomes = damage.run_cases(case, folder, seeds)
    wrong = [f"{case} {seed}: {what}" for seed, what in outcomes.items() if what.startswith("WRONG")]
    assert not wrong, "\n".join(wrong)
    assert len(outcomes) == len(seeds)
    return Counter(what.partition(":")[0] for what in outcomes.values())


@pytest.mark.parametrize("case", SHORT)
def test_a_damaged_file_is_read_as_it_was_or_refused_by_name(made, case):
    found = right(case, made(case), range(SHORT[case]))
    assert found["refused"] >= SHORT[case] // 4


def test_a_crash_and_a_hang_are_told_with_their_seed(tmp_path):
    outcomes = damage.run_cases("ended", tmp_path, range(3))
    assert [outcomes[seed].partition(":")[0] for seed in range(3)] == ["same", "WRONG", "WRONG"]
    assert "code -11" in outcomes[1]
    assert "Timeout" in outcomes[2]


@pytest.mark.slow
@pytest.mark.parametrize("case", LONG)
def test_the_damage_campaign(made, case):
    print(case, dict(right(case, made(case), range(1000, 1000 + LONG[case]))))

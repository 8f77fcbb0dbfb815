"""Every solver on problems by seed: each ends in numbers that can be read, with its status, or in a refusal that helps.

A case runs again as `outcome(PROBLEMS[family](seed)[1])`.
"""

import pytest

from degenerate import outcome
from degenerate_problems import PROBLEMS
from hard_summary import SCALE, note

CASES = {"elastic": 120, "response": 1600, "rigid": 120, "external": 100, "lpv": 100, "design": 1200}
CHUNK = {"elastic": 8, "response": 400, "rigid": 15, "external": 8, "lpv": 12, "design": 400}
"""As many as take some ten seconds."""

pytestmark = pytest.mark.hard


def chunks(family):
    whole = max(1, round(SCALE * CASES[family]))
    return [(family, first, min(first + CHUNK[family], whole)) for first in range(0, whole, CHUNK[family])]


@pytest.mark.parametrize(("family", "first", "last"), [one for family in CASES for one in chunks(family)])
def test_a_solver_ends_with_numbers_or_a_remedy(family, first, last):
    outcomes = {}
    # Seeds apart from those of the tests that run always.
    for seed in range(1000 + first, 1000 + last):
        name, call = PROBLEMS[family](seed)
        ended = outcome(call)
        outcomes[seed] = f"{ended} ({name})" if ended.startswith("WRONG") else ended
    note(f"solver_{family}", first, outcomes)

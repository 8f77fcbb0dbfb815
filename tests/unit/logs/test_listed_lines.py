"""A wrong period of a log whose lines were listed: the remedy lists lines, since no count says them."""

import numpy as np

from robid.logs.mapping import Stated
from robid.logs.period_checks import check_period


def told(listed):
    """What is said of a period of 400 samples that was stated as 800."""
    lines, time = np.arange(3, 30, 2), np.arange(3200)
    phases = np.random.default_rng(1).uniform(0, 2 * np.pi, len(lines))
    signal = np.cos(2 * np.pi * np.outer(time, lines) / 400 + phases).sum(axis=1)
    stated = Stated(1e-3, 800, 4, 0, np.arange(6, 60, 3), listed=listed)
    (problem,), _ = check_period("log.mat, variable u", signal, stated)
    return str(problem)


def test_listed_lines_are_corrected_by_a_list():
    counted, listed = told(listed=False), told(listed=True)
    assert "excitation.period_s to 0.4" in counted
    assert "excitation.count to 13" in counted
    assert "excitation.lines to [3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27]" in listed
    assert "count" not in listed
    assert "low_hz" not in listed

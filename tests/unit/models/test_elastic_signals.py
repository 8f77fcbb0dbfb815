"""Which configurations a page shows in time, and what of them."""

import numpy as np
import pytest

from robid.frf.replay import Replay
from robid.models.elastic.page.signals import Signals, excerpt, signal_section, worst_of
from robid.report.costs import CostRow
from robid.report.section import Choices, Table


def test_the_worst_configurations_are_shown_in_their_order():
    costs = [
        CostRow("c", index, cost, noise, None) for index, (cost, noise) in enumerate([(9, 9), (8, 2), (1, 1), (6, 2)])
    ]
    assert worst_of(costs, 4, 2) == [1, 3]
    assert worst_of(costs, 4, 9) == [0, 1, 2, 3]
    assert worst_of((), 3, 2) == [0, 1]


def test_an_excerpt_holds_the_largest_difference():
    for place in (0, 480, 999):
        difference = np.sin(np.arange(1000.0))
        difference[place] = -7.0
        part = excerpt(difference)
        assert part.stop - part.start == 80
        assert part.start <= place < part.stop <= 1000


def test_every_output_and_configuration_is_shown_with_its_difference():
    time = np.arange(4000) / 1000
    measured = np.stack([np.sin(3 * time), np.cos(5 * time)], axis=1)
    measured[1234, 0] = 9.0
    found = Replay(time, measured, 0.5 * measured, measured)
    signals = [
        Signals(name, ("a", "b"), ("rad/s^2", "m/s^2"), ("acceleration", "acceleration"), found) for name in ("1", "2")
    ]
    (section,) = signal_section(signals)
    (choices,) = (part for part in section.parts if isinstance(part, Choices))
    assert [names for names, _ in choices.options] == [("a", "1"), ("a", "2"), ("b", "1"), ("b", "2")]
    _, (period, difference, part) = choices.options[0]
    assert max(period.curves[0].y) == 9.0
    assert max(difference.curves[0].y) == pytest.approx(4.5)
    assert min(part.curves[1].x) <= 1.234 <= max(part.curves[1].x)
    (table,) = (part for part in section.parts if isinstance(part, Table))
    assert table.texts == (("1", "50 %", "50 %"), ("2", "50 %", "50 %"))
    assert signal_section(()) == ()

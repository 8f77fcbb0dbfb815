"""The page that lays responses over each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robid.frf.comparison import compare
from robid.report.charts import BodeMatrix, bode_data
from robid.report.comparison import Compared, comparison_content, comparison_verdict
from robid.report.page import render
from robid.report.section import Notes
from robid.signals.quantities import Channel
from sample_reports import synthetic_frf

NAMES = ("turn", "lift")


def measured(seed, *, change=1.0, places=(0.0, 1.0)):
    frequency_hz = np.arange(10.0, 40.0)
    truth = np.full((len(places), 30, 2, 2), 2.0 - 1.0j) * change
    return synthetic_frf(truth, frequency_hz, np.array(places)[:, None], 0.01, NAMES, NAMES, seed)


def compared(label, first, second):
    return Compared(label, second, compare(first, second))


@pytest.fixture(scope="module")
def first():
    return measured(1)


def test_each_response_is_laid_over_the_first_where_it_belongs(first):
    truth = np.full((1, 30, 2, 2), 5.0 + 0j)
    other = replace(measured(2, places=(1.0,)), response=truth, output_channels=first.output_channels[::-1])
    other.response[0, :, 0] = 3.0
    content = comparison_content("first", first, [compared("other", first, other)])
    (bode,) = (part for part in content.sections[0].parts if isinstance(part, BodeMatrix))
    drawn = bode_data(bode)["responses"][0]["configurations"]
    assert all(value is None for value in drawn[0]["overlays"][0]["magnitude"][0][0])
    assert drawn[0]["overlays"][0]["radius"] is None
    decibels = [drawn[1]["overlays"][0]["magnitude"][row][0][0] for row in (0, 1)]
    assert decibels == pytest.approx([20 * np.log10(5), 20 * np.log10(3)], abs=0.01)
    assert drawn[1]["overlays"][0]["radius"][0][0][0] > 0


def test_an_element_that_only_the_first_has_stays_empty(first):
    part = replace(measured(2), output_channels=(first.output_channels[0], Channel("other", "acceleration", "rad/s^2")))
    content = comparison_content("first", first, [compared("other", first, part)])
    (bode,) = (part for part in content.sections[0].parts if isinstance(part, BodeMatrix))
    drawn = bode_data(bode)["responses"][0]["configurations"][0]["overlays"][0]["magnitude"]
    assert drawn[0][0][0] is not None
    assert drawn[1][0][0] is None
    assert len(content.sections[1].tables[0].rows) == 2
    (notes,) = (part for part in content.sections[1].parts if isinstance(part, Notes))
    assert any("Only one of them has the outputs lift, other." in note for note in notes.items)


def test_the_verdict_says_which_agree_and_what_differs_the_most(first):
    changed = measured(3)
    changed.response[:, :, 1, 0] *= 1.5
    others = [compared("same", first, measured(2)), compared("changed", first, changed)]
    verdict = comparison_verdict("first", others)
    assert verdict.startswith("same agrees within both uncertainties, in all 4 elements, with first.")
    assert "changed differs in 1 of 4 elements (the most in lift per turn, by 5" in verdict
    content = comparison_content("first", first, others)
    assert content.verdict.level == "warn"
    assert comparison_content("first", first, others[:1]).verdict.level == "ok"
    assert [len(table.rows) for table in content.sections[1].tables] == [4, 2 * 4]
    assert content.sections[2].tables[0].texts[2][-1] == "differs"
    assert "first against same" in render(comparison_content("first", first, others[:1]))
    assert "3 responses" in render(content)


def test_an_unknown_uncertainty_is_not_called_agreement(first):
    bare = replace(measured(2), total_covariance=None, noise_covariance=None)
    content = comparison_content("first", first, [compared("bare", first, bare)])
    assert content.verdict.level == "warn"
    assert "bare has no known uncertainty to be compared with that of first." in content.verdict.text

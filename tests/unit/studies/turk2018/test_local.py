"""Figures, tables and pictures of a model at rest, on a system that is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, local_responses
from robid.models.lpv.fit.fitting import fit_lpv, hold
from robid.models.lpv.fit.options import BasisOptions, LpvOptions, PathOptions
from robid.models.lpv.fit.solution import Ports
from robid.report.charts import Waterfall
from robid.report.numbers import MINUS, MISSING
from robid.studies.turk2018.rest import (
    asked_of,
    below_response_db,
    block_section,
    bode_section,
    deviations,
    error_ratio,
    left_out_section,
    nearness_section,
    rest_figures,
    share_within,
)

PORTS = Ports(("u",), ("N m",), ("y1", "y2"), ("rad/s^2", "m/s^2"), ("slide",), ("m",), 1.0)
PAPER = {
    "order": 3,
    "dropped": ["B1"],
    "smile": {"absolute": [[1.0] * 5] * 4, "relative": [[0.5] * 4] * 4},
    "regularized": {"absolute": [[1.0] * 5] * 4, "relative": [[0.25] * 4] * 4},
}


@pytest.fixture(scope="module")
def solution():
    generator = np.random.default_rng(3)
    own, choosing = local_responses(POSITIONS, generator), local_responses(np.array([[0.2]]), generator)
    options = LpvOptions(order=3, path=PathOptions(count=2, smallest=30, largest=300))
    levels = {"degrees_of_freedom": 3.0, "confidence": 0.95, "identifiable_relative_std": 0.2}
    return fit_lpv(own, choosing, PORTS, BasisOptions(), options, **levels)


@pytest.fixture(scope="module")
def left_out(solution):
    measured = local_responses(LEFT_OUT, np.random.default_rng(4))
    return hold(measured, solution.response(LEFT_OUT, measured.frequency_hz), 3.0, seen=False)


def shifted(held, factor):
    """The same, its model off by a factor of the deviation everywhere."""
    return replace(held, modelled=held.response + factor * held.std * np.exp(1j))


def test_errors_are_counted_in_deviations_of_what_was_measured(left_out):
    twice = shifted(left_out, 1.5)
    ratio = deviations(twice, twice.modelled)
    np.testing.assert_allclose(ratio, 1.5)
    assert (share_within(ratio, 2.0), share_within(ratio, 1.0)) == (1, 0)
    assert error_ratio(twice, twice.modelled, 1) == pytest.approx(1.5)
    # Half of the lines without an error, the others beyond two deviations.
    half = np.arange(left_out.response.shape[1])[:, None, None] % 2
    mixed = left_out.response + 3 * half * left_out.std
    assert share_within(deviations(left_out, mixed), 2.0) == 0.5
    assert error_ratio(left_out, mixed, 1) == pytest.approx(np.sqrt(4.5))


def test_what_is_left_out_or_unknown_does_not_count(left_out):
    std = left_out.std.copy()
    std[:, :50], std[:, 50:60] = np.inf, np.nan
    some = replace(left_out, std=std)
    wrong = left_out.response + 0.5 * left_out.std
    wrong[:, :60] += 1e6
    assert np.isnan(deviations(some, wrong)[:, :60]).all()
    assert error_ratio(some, wrong, 9) == pytest.approx(0.5, rel=1e-9)
    assert share_within(deviations(some, wrong), 1.0) == 1
    assert np.isnan(share_within(np.full(3, np.nan), 1.0))


def test_deviations_are_told_in_decibels_below_the_response(left_out):
    scale = np.array([0.1, 0.01])[:, None]
    known = replace(left_out, std=np.abs(left_out.response) * scale)
    np.testing.assert_allclose(below_response_db(known), [20, 40])


def test_the_sparse_model_is_compared_with_the_one_of_all_blocks(solution, left_out):
    figures = rest_figures(solution, left_out, 9)
    assert figures["blocks_dropped"] == 14
    assert figures["local.share_within_2std"] == pytest.approx(1 - np.exp(-4), abs=0.02)
    assert figures["local.share_within_1std"] == pytest.approx(1 - np.exp(-1), abs=0.04)
    assert figures["perfect_share_within_1std"] == pytest.approx(1 - (3 / 4) ** 3)
    assert figures["local.median_deviation_db.y1"] == pytest.approx(40, abs=12)
    # Weights are those of the truth, so either ratio is near 1, and all blocks only fit more noise.
    assert figures["left_out.error_ratio"] == pytest.approx(1, abs=0.1)
    assert figures["left_out.full_error_ratio"] > figures["left_out.error_ratio"]
    assert figures["left_out.excess_percent"] < 0
    worse = replace(left_out, modelled=left_out.response + 2 * left_out.std)
    full = figures["left_out.full_error_ratio"]
    assert rest_figures(solution, worse, 9)["left_out.excess_percent"] == pytest.approx(100 * (2 / full - 1))


def test_levels_of_every_output_are_asked_for(solution, left_out):
    asked = asked_of(rest_figures(solution, left_out, 9))
    assert {name for name in asked if "median" in name} == {
        f"{where}.median_deviation_db.{output}" for where in ("local", "left_out") for output in ("y1", "y2")
    }
    assert not asked["left_out.median_deviation_db.y1"].is_reached(40)
    assert asked["blocks_dropped"].is_reached(7)


def test_blocks_stand_beside_the_papers(solution):
    section = block_section(solution, PAPER)
    first, second, third, fourth = (table.texts for table in section.tables)
    assert [row[0] for row in first] == ["1", "p", "p²", "p³", "p⁴"]
    assert [row[0] for row in fourth] == ["p", "p²", "p³", "p⁴"]
    assert all(row[1::2] == ("0.500",) * 4 for row in second)
    kept = [[cell != "0" for cell in row[2::2]] for row in fourth]
    assert [list(one) for one in zip(*kept, strict=True)] == solution.blocks.kept.tolist()
    # In any basis the SMILE model's C is as large as its largest output makes it; here it has all blocks.
    assert "0" not in {cell for row in first for cell in row[2::2]}
    assert third[0][2] == f"{solution.blocks.absolute[0, 0]:.3g}".ljust(4, "0")
    assert "no integrator apart" in section.lead


def test_all_models_are_near_their_data(solution, left_out):
    (table,) = nearness_section(solution, left_out, 9).tables
    assert [row[1] for row in table.texts] == ["16", "16", "2", MISSING] * 2
    assert [row[2] for row in table.texts][3] == "92 %"
    assert all(int(row[2].split()[0]) >= 94 for place, row in enumerate(table.texts) if place % 4 < 3)


def test_pictures_show_each_output_at_its_positions(solution):
    section = bode_section(solution)
    figures = [figure for beside in section.parts for figure in beside.parts]
    assert [type(figure) for figure in figures] == [Waterfall] * 4
    magnitude, phase = figures[2:]
    assert magnitude.places == (-1.0, -0.5, 0.0, 0.5, 1.0)
    measured, sparse, smile = magnitude.layers
    line = solution.own.frequency_hz.tolist().index(measured.x[-1])
    size = 20 * np.log10(np.abs(solution.own.response[:, line, 1, 0]))
    np.testing.assert_allclose([row[-1] for row in measured.heights], size)
    assert len(measured.x) < len(sparse.x) == len(solution.own.frequency_hz)
    np.testing.assert_allclose(smile.heights, sparse.heights, atol=1.0)
    turns = np.abs(np.diff(phase.layers[1].heights, axis=1))
    assert turns.max() < 180
    np.testing.assert_allclose(phase.layers[2].heights, phase.layers[1].heights, atol=10)


def test_the_position_left_out_shows_model_and_deviations(solution, left_out):
    variance = np.full(left_out.response.shape, 1e-6)

    def variances(*, noise_only):
        assert noise_only
        return np.concatenate([9 * variance[:, :, :1], variance], axis=2)

    measured = SimpleNamespace(
        output_names=("other", "y1", "y2"),
        input_names=("u",),
        element_variance=variances,
    )
    section = left_out_section(solution, left_out, measured)
    (first, _) = section.parts[0].parts
    assert first.title == f"y1 by u at {MINUS}0.25 m"
    curves = {curve.name: np.array(curve.y) for curve in first.curves}
    np.testing.assert_allclose(curves["by noise alone"], -60)
    np.testing.assert_allclose(curves["|G|"], 20 * np.log10(np.abs(left_out.response[0, :, 0, 0])))
    np.testing.assert_allclose(
        curves[f"|G {MINUS} model|"], 20 * np.log10(np.abs((left_out.response - left_out.modelled)[0, :, 0, 0]))
    )

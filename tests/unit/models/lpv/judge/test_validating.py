"""Verdicts on position-dependent models: right ones hold, wrong ones do not, by absolute limits."""

from dataclasses import replace

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, local_responses
from robid.errors import DataError
from robid.models.lpv.fit.fitting import fit_lpv
from robid.models.lpv.fit.options import BasisOptions, LpvOptions, PathOptions
from robid.models.lpv.fit.solution import Ports
from robid.models.lpv.judge import assess_lpv, validate_lpv
from robid.results.finding import Finding

PORTS = Ports(("u",), ("N m",), ("y1", "y2"), ("rad", "m"), ("slide",), ("m",), 1.0)
NEW = np.array([[0.3], [0.8]])


@pytest.fixture(scope="module")
def solution():
    generator = np.random.default_rng(3)
    own, choosing = local_responses(POSITIONS, generator), local_responses(LEFT_OUT, generator)
    options = LpvOptions(order=3, path=PathOptions(count=2, smallest=30, largest=300))
    levels = {"degrees_of_freedom": 3.0, "confidence": 0.95, "identifiable_relative_std": 0.2}
    return fit_lpv(own, choosing, PORTS, BasisOptions(), options, **levels)


def new_responses(seed=4, points=NEW, factor=1.0):
    found = local_responses(points, np.random.default_rng(seed))
    return replace(found, response=found.response * factor)


def test_a_right_model_is_to_be_trusted(solution):
    assert assess_lpv(solution).value == 1
    found = validate_lpv(solution, PORTS, new_responses(), 3.0)
    assert found.outcome.ok
    assert found.outcome.grade.value == 2
    assert found.new.all()
    assert found.held.agreement.share_within.mean() == pytest.approx(1 - np.exp(-4), abs=0.02)
    assert "predicts new data" in found.outcome.verdict


@pytest.mark.parametrize(("factor", "grade"), [(1.05, 2), (1.2, 1), (1.6, 0)])
def test_limits_are_absolute(solution, factor, grade):
    found = validate_lpv(solution, PORTS, new_responses(factor=factor), 3.0)
    assert found.outcome.grade.value == grade
    assert found.outcome.ok == (grade > 0)
    together = np.sqrt(np.mean(found.held.agreement.excess**2, axis=0))
    np.testing.assert_allclose(together, 1 - 1 / factor, atol=0.02)


@pytest.mark.parametrize(("excess", "grade"), [(0.05, 2), (0.2, 1), (0.6, 0)])
def test_what_only_chooses_the_structure_must_be_met_too(solution, excess, grade):
    agreement = solution.choosing.agreement
    far = replace(agreement, excess=np.full_like(agreement.excess, excess))
    off = replace(solution, choosing=replace(solution.choosing, agreement=far))
    alone = assess_lpv(off)
    assert validate_lpv(off, PORTS, new_responses(), 3.0, alone.findings).outcome.grade.value == grade
    assert ("on what chooses the structure" in alone.sentence) == (grade < 2)


@pytest.mark.parametrize(("ratio", "grade"), [(1.5, 2), (5.0, 1)])
def test_errors_beyond_their_deviations_put_single_poles_in_finding(solution, ratio, grade):
    agreement = solution.own.agreement
    far = replace(agreement, error_ratio=np.full_like(agreement.error_ratio, ratio))
    alone = assess_lpv(replace(solution, own=replace(solution.own, agreement=far)))
    assert validate_lpv(solution, PORTS, new_responses(), 3.0, alone.findings).outcome.grade.value == grade
    assert ("poles may be off" in alone.sentence) == (grade < 2)


@pytest.mark.parametrize(("level", "grade"), [(0.3, 2), (3.0, 1)])
def test_noise_that_would_hide_an_error_is_no_proof(solution, level, grade):
    exact = new_responses()
    size = level * np.sqrt(np.mean(np.abs(exact.response) ** 2, axis=1, keepdims=True)) + 0 * exact.variance
    generator = np.random.default_rng(9)
    noise = size * (generator.standard_normal(size.shape) + 1j * generator.standard_normal(size.shape)) / np.sqrt(2)
    noisy = replace(exact, response=exact.response + noise, variance=size**2)
    found = validate_lpv(solution, PORTS, noisy, 3.0)
    assert found.outcome.ok
    assert found.outcome.grade.value == grade
    assert ("could hide an error" in found.outcome.grade.sentence) == (grade < 2)


def test_the_same_positions_again_are_no_test(solution):
    found = validate_lpv(solution, PORTS, new_responses(points=POSITIONS), 3.0)
    assert not found.new.any()
    assert found.outcome.grade.value == 1
    assert "nothing was tested in between" in found.outcome.grade.sentence


def test_what_is_unstable_or_has_not_converged_is_not_to_be_used(solution):
    unstable = replace(solution, largest_pole=1.01)
    assert assess_lpv(unstable).value == 0
    assert "unstable within its range" in assess_lpv(unstable).sentence
    stalled = replace(solution, estimate=replace(solution.estimate, status="stalled"))
    assert validate_lpv(stalled, PORTS, new_responses(), 3.0).outcome.grade.value == 0
    moved = Finding("model", "another joint moved", decisive=False, strength=1.5)
    assert validate_lpv(solution, PORTS, new_responses(), 3.0, [moved]).outcome.grade.value == 1


def test_other_channels_and_positions_outside_are_refused(solution):
    with pytest.raises(DataError, match="other channels"):
        validate_lpv(solution, replace(PORTS, outputs=("y1", "y3")), new_responses(), 3.0)
    with pytest.raises(DataError, match=r"The model is valid from -1 to 1, not at 1\.5"):
        validate_lpv(solution, PORTS, new_responses(points=np.array([[1.5]])), 3.0)

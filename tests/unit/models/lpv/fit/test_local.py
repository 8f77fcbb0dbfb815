"""Local models come back from their responses, whatever the rates; what cannot be fitted is refused."""

import numpy as np
import pytest

from lpv_systems import POSITIONS, SIZES, local_responses, problem, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.local import _rank, balanced_or_refused, fit_local_models, subspace_model
from robid.models.lpv.fit.responses import Problem
from robid.models.lpv.fit.state_space import Sizes, StateSpace, response
from tolerances import RECOVERY


def _two_by_two(z, n_pos=3):
    """Two modes and a slow pole, two inputs and outputs, far below the sampling rate."""
    period = 1 / 4000
    systems = []
    for position in range(n_pos):
        poles = 2 * np.pi * np.array([2.0, 40.0 + 5 * position, 110.0])
        first = np.exp(period * -poles[0])
        blocks = np.zeros((5, 5))
        blocks[0, 0] = first
        for index, pole in enumerate(poles[1:]):
            value = np.exp(period * pole * (-0.03 + 1j))
            here = slice(1 + 2 * index, 3 + 2 * index)
            blocks[here, here] = [[value.real, value.imag], [-value.imag, value.real]]
        generator = np.random.default_rng(7)
        systems.append((blocks, *(generator.standard_normal(s) for s in ((5, 2), (2, 5), (2, 2)))))
    system = StateSpace(*(np.stack(group) for group in zip(*systems, strict=True)))
    return system, response(system, z)


def test_a_subspace_realises_a_response_without_noise():
    z = np.exp(2j * np.pi * np.linspace(1, 150, 120) / 4000)
    _, exact = _two_by_two(z)
    model = subspace_model(z, exact[0], np.ones(exact[0].shape), order=5, n_block=12)
    np.testing.assert_allclose(response(model, z), exact[0], atol=1e-6 * np.abs(exact).max())
    assert model.spectral_radius < 1


def test_a_subspace_model_is_stable_even_of_a_response_that_is_not():
    exact = local_responses(POSITIONS)
    wild = true_systems(POSITIONS)[3]
    unstable = StateSpace(1.1 * wild.A, wild.B, wild.C, wild.D)
    assert unstable.spectral_radius > 1
    measured = response(unstable, exact.z)
    assert subspace_model(exact.z, measured, np.ones(measured.shape), order=3, n_block=8).spectral_radius < 1


def test_local_models_with_several_inputs_come_back():
    z = np.exp(2j * np.pi * np.linspace(1, 150, 120) / 4000)
    system, exact = _two_by_two(z)
    posed = Problem(z, exact, np.ones(exact.shape), np.ones((3, 1)), Sizes(5, 2, 2))
    found = fit_local_models(posed)
    np.testing.assert_allclose(response(found.systems, z), exact, atol=RECOVERY * np.abs(exact).max())
    ours, truth = np.linalg.eigvals(found.systems.A), np.linalg.eigvals(system.A)
    for one, other in zip(ours, truth, strict=True):
        np.testing.assert_allclose(np.sort_complex(one), np.sort_complex(other), rtol=RECOVERY)


def test_the_cost_of_noise_is_that_of_its_degrees_of_freedom():
    posed = problem(local_responses(POSITIONS, np.random.default_rng(0)))
    found = fit_local_models(posed)
    # 400 complex elements and 11 real combinations of parameters a position; the sum of five scatters by 44.
    assert abs(found.cost.sum() - 5 * (400 - 11 / 2)) < 4 * np.sqrt(5 * 394.5)
    assert set(found.status) == {"converged"}
    truth = response(true_systems(POSITIONS), posed.z)
    assert np.all(np.abs(response(found.systems, posed.z) - truth) * posed.root_weight < 1)


def test_too_few_lines_are_refused():
    responses = local_responses(POSITIONS, frequency=np.array([0.05, 0.2]))
    with pytest.raises(DataError, match="too few for 3 states"):
        fit_local_models(problem(responses))


def test_an_unstable_local_model_is_refused_by_position():
    exact = local_responses(POSITIONS)
    grown = true_systems(POSITIONS)
    wild = StateSpace(grown.A.copy(), grown.B, grown.C, grown.D)
    wild.A[3] *= 1.03
    unstable = response(wild, exact.z)
    posed = Problem(exact.z, unstable, np.ones(unstable.shape), np.ones((5, 1)), SIZES)
    with pytest.raises(DataError, match="unstable") as caught:
        fit_local_models(posed)
    assert caught.value.where == "position 3"
    assert "integrators" in caught.value.remedy
    with pytest.raises(DataError, match="unstable"):
        balanced_or_refused(wild[3], 3)


def test_a_stable_fit_is_preferred_to_a_better_one_that_is_not():
    stable = true_systems(POSITIONS)[0]
    wild = StateSpace(1.2 * stable.A, stable.B, stable.C, stable.D)
    found = [(wild, 1.0, "converged"), (stable, 3.0, "converged"), (stable, 2.0, "converged")]
    assert min(found, key=_rank) is found[2]

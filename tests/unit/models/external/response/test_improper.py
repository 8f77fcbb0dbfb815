"""Improper plants, s times proper ones: they come back where they are allowed, and are named where they are not."""

import numpy as np
import pytest

import robid
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions
from robid.studies.responses.plants import draw
from tolerances import RECOVERY_SIGMA

NOISE = 0.005
SEEDS = [6, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 5, 8))]
PROPER, IMPROPER = (ResponseFitOptions(max_poles=12, stable=True, relative_degree=least) for least in (0, -1))


def improper(kind, seed):
    """A random plant and a direct term, times s: the true poles, the response and what is measured of it.

    The s cancels an integrator where there is one.
    """
    plant, data = draw(kind, seed)
    f, rng = data.frequency_hz, np.random.default_rng(seed)
    G = plant.response(f)
    s = 2j * np.pi * f / (2 * np.pi * np.sqrt(f[0] * f[-1]))
    G = (G + np.median(np.abs(G)) * rng.choice([-1, 1])) * s[:, None, None]
    variance = (NOISE * np.abs(G)) ** 2
    error = (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)) * np.sqrt(variance / 2)
    poles = plant.poles[np.abs(plant.poles) > 0]
    return poles, max(plant.integrators - 1, 0), G, MeasuredResponse(f, G + error, variance)


@pytest.mark.parametrize("kind", ["siso", "integrators"])
@pytest.mark.parametrize("seed", SEEDS)
def test_random_improper_plants_come_back_where_they_are_allowed(kind, seed):
    poles, integrators, G, data = improper(kind, seed)
    fit = fit_response(data, IMPROPER)
    assert (fit.n_pole, fit.integrators) == (len(poles) + integrators, integrators)
    assert len(fit.zeros[0][0]) == fit.n_pole + 1
    assert fit.missing_zeros == 0
    for root in fit.poles:
        off = root.place - poles[np.argmin(np.abs(poles - root.place))]
        assert abs(off.real) < RECOVERY_SIGMA * np.linalg.norm(root.moves.real)
        assert abs(off.imag) <= RECOVERY_SIGMA * np.linalg.norm(root.moves.imag)
    found = fit.response_at(data.frequency_hz)
    deviation = np.hypot(found.real_std, found.imaginary_std)
    # In the mean over lines an error is as large as its deviation; few parameters make it vary.
    assert 0.2 < np.mean(np.abs(found.response - G) ** 2 / deviation**2) < 3


@pytest.mark.parametrize("kind", ["siso", "integrators"])
@pytest.mark.parametrize("seed", SEEDS)
def test_where_they_are_not_allowed_a_pole_beyond_all_lines_is_named(kind, seed):
    poles, integrators, _, data = improper(kind, seed)
    fit = fit_response(data, PROPER)
    assert fit.n_pole == len(poles) + integrators + 1
    assert abs(fit.poles[-1].place) > 2 * np.pi * data.frequency_hz[-1]
    assert fit.missing_zeros == 1


@pytest.mark.parametrize("kind", ["siso", "delay", "integrators", "noncollocated"])
@pytest.mark.parametrize("seed", [22, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (21, 23))])
def test_proper_plants_are_not_accused(kind, seed):
    assert fit_response(draw(kind, seed)[1], PROPER).missing_zeros == 0


def test_a_coil_is_its_resistance_and_inductance_and_a_remark_names_the_option():
    """Voltage per current: R + s L has no pole at all."""
    f = np.geomspace(1, 1000, 80)
    resistance, inductance = 0.7, 2e-3
    exact = resistance + 2j * np.pi * f * inductance
    generator = np.random.default_rng(4)
    measured = exact * (1 + NOISE * generator.normal(size=(2, f.size)).T @ [1, 1j] / np.sqrt(2))
    about = {
        "inputs": [{"name": "axis", "unit": "A", "normalised": True, "quantity": "current"}],
        "outputs": [{"name": "axis", "unit": "rad"}],
        "deviation": NOISE * np.abs(exact),
        "accelerations": False,
    }
    coil = robid.make_responses(f, measured, **about)
    fit = robid.fit_model("external", coil, relative_degree=-1)
    transfers = fit.found.solution.transfers
    assert (transfers.poles.tolist(), transfers.zeros.tolist()) == ([0], [1])
    np.testing.assert_allclose(transfers.numerator[0], [inductance, resistance], rtol=RECOVERY_SIGMA * NOISE / 3)
    assert fit.found.solution.remarks == ()
    (remark,) = robid.fit_model("external", coil).found.solution.remarks
    assert "`relative_degree: -1`" in remark

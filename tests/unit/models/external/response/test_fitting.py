"""Fits to responses: known plants come back, intervals are as wide as noise makes them, the choice follows evidence."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy import signal
from scipy.stats import kstest

from robid.models.external.response.choice import Candidate
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.descent import descend
from robid.models.external.response.fitting import fit_response, make_result
from robid.models.external.response.lines import make_lines
from robid.models.external.response.options import ResponseFitOptions
from tolerances import RECOVERY_SIGMA

EXACT = 1e-8

FREQUENCY = np.geomspace(0.5, 500, 200)


def polynomial(*pairs, real=()):
    """The polynomial of pairs (frequency [Hz], damping) and of real poles [Hz]."""
    found = np.ones(1)
    for f, zeta in pairs:
        w = 2 * np.pi * f
        found = np.convolve(found, [1, 2 * zeta * w, w**2])
    for f in real:
        found = np.convolve(found, [1, 2 * np.pi * f])
    return found


def scaled(numerator, denominator):
    """A numerator with a response of about one amid the band."""
    s = 2j * np.pi * 16
    return numerator * abs(np.polyval(denominator, s) / np.polyval(numerator, s))


DENOMINATOR = polynomial((8, 0.03), (60, 0.002), real=(2,))
NUMERATOR = scaled(polynomial((12, 0.02), (65, 0.004)), DENOMINATOR)


def measured(numerator, denominator, *, delay=0.0, frequency=FREQUENCY, share=0.02, seed=None, **others):
    """What an analyser gives of one element, by another library's evaluation; exact without a seed."""
    omega = 2 * np.pi * frequency
    _, G = signal.freqs(numerator, denominator, omega)
    G = G * np.exp(-1j * omega * delay)
    variance = (share * np.abs(G)) ** 2 + (share * np.median(np.abs(G)) / 10) ** 2
    if seed is not None:
        rng = np.random.default_rng(seed)
        G = G + np.sqrt(variance / 2) * (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape))
    return MeasuredResponse(frequency, G[:, None, None], variance[:, None, None], **others)


def places(roots):
    return in_order(np.array([root.place for root in roots]))


def in_order(found):
    """Roots by frequency, then by the sign of the imaginary part."""
    return found[np.lexsort((found.imag, np.round(np.abs(found), 6)))]


def again(fit, seed):
    """The same structure fitted to other noise, from the first fit's place."""
    data = measured(NUMERATOR, DENOMINATOR, delay=2e-3, seed=seed)
    lines, own = make_lines(data, "continuous"), fit.spread.state
    state = descend(lines, own.denominator, own.delay, own.degrees, longest=100.0, tolerance=1e-9)
    return make_result(lines, state, data, ResponseFitOptions(), [Candidate(state, 0.0, 100.0)])


def test_an_exact_response_gives_its_transfer_function_back():
    fit = fit_response(measured(NUMERATOR, DENOMINATOR), ResponseFitOptions(poles=5, delay=0.0))
    np.testing.assert_allclose(places(fit.poles), in_order(np.roots(DENOMINATOR)), rtol=EXACT)
    exact = signal.freqs(NUMERATOR, DENOMINATOR, 2 * np.pi * FREQUENCY)[1]
    np.testing.assert_allclose(fit.response_at(FREQUENCY).response[:, 0, 0], exact, rtol=EXACT)
    own = signal.freqs(fit.numerator[0, 0], fit.denominator, 2 * np.pi * FREQUENCY)[1]
    np.testing.assert_allclose(own, exact, rtol=EXACT)


def test_an_exact_response_gives_zeros_gain_and_delay_back():
    fit = fit_response(measured(NUMERATOR, DENOMINATOR, delay=2e-3), ResponseFitOptions(poles=5, zeros=4))
    assert fit.delay_s == pytest.approx(2e-3, rel=EXACT)
    np.testing.assert_allclose(places(fit.zeros[0][0]), in_order(np.roots(NUMERATOR)), rtol=EXACT)
    np.testing.assert_allclose(fit.gain[0, 0], NUMERATOR[-1] / DENOMINATOR[-1], rtol=EXACT)


def test_elements_share_their_poles():
    rng = np.random.default_rng(1)
    above = [
        [scaled(rng.standard_normal(5) * np.abs(DENOMINATOR[1:]), DENOMINATOR) for _ in range(3)] for _ in range(2)
    ]
    system = control.tf(above, [[DENOMINATOR] * 3] * 2)
    G = np.moveaxis(system(2j * np.pi * FREQUENCY), -1, 0)
    data = MeasuredResponse(FREQUENCY, G, (0.01 * np.abs(G)) ** 2)
    fit = fit_response(data, ResponseFitOptions(poles=5, delay=0.0))
    np.testing.assert_allclose(places(fit.poles), in_order(np.roots(DENOMINATOR)), rtol=EXACT)
    np.testing.assert_allclose(fit.response_at(FREQUENCY).response, G, rtol=EXACT, atol=EXACT * np.abs(G).max())


@pytest.mark.parametrize("integrators", [1, 2])
def test_integrators_are_chosen(integrators):
    below = np.append(polynomial((20, 0.01)), np.zeros(integrators))
    fit = fit_response(measured(scaled(polynomial((14, 0.02)), below), below, seed=integrators))
    assert (fit.n_pole, fit.integrators) == (2 + integrators, integrators)
    true = scaled(polynomial((14, 0.02)), below)[-1] / below[2]
    assert abs(fit.gain[0, 0] - true) < RECOVERY_SIGMA * fit.gain_std[0, 0]


def test_improper_models_are_fitted_where_allowed():
    above, below = polynomial((3, 0.1), (40, 0.02)), polynomial((15, 0.05), real=(80,))
    fit = fit_response(measured(above, below), ResponseFitOptions(poles=3, zeros=4, relative_degree=-1, delay=0.0))
    np.testing.assert_allclose(places(fit.zeros[0][0]), in_order(np.roots(above)), rtol=EXACT)


@pytest.mark.parametrize("delay", [0, 3])
def test_discrete_time(delay):
    period = 1e-3
    below = np.real(np.poly([0.9 * np.exp(0.4j), 0.9 * np.exp(-0.4j), 0.98 * np.exp(1.3j), 0.98 * np.exp(-1.3j), 0.95]))
    above = np.array([0.2, -0.1, 0.15, 0.05])
    # b_0 + .. + b_3 z^-3 over 1 + .. + a_5 z^-5
    frequency = np.linspace(2, 499, 180)
    _, G = signal.freqz(above, below, worN=frequency, fs=1 / period)
    G = G * np.exp(-2j * np.pi * frequency * period * delay)
    variance = (0.01 * np.abs(G)) ** 2
    rng = np.random.default_rng(delay)
    noisy = G + np.sqrt(variance / 2) * (rng.standard_normal(180) + 1j * rng.standard_normal(180))
    data = MeasuredResponse(frequency, noisy[:, None, None], variance[:, None, None], period)
    fit = fit_response(data, ResponseFitOptions(time="discrete"))
    assert (fit.n_pole, len(fit.zeros[0][0]), round(fit.delay_s / period)) == (5, 3, delay)
    exact = fit_response(
        replace(data, response=G[:, None, None]), ResponseFitOptions(time="discrete", poles=5, zeros=3, delay=delay)
    )
    np.testing.assert_allclose(places(exact.poles), in_order(np.roots(below)), rtol=EXACT)
    np.testing.assert_allclose(exact.numerator[0, 0], [*above, 0.0, 0.0], atol=EXACT)
    np.testing.assert_allclose(exact.gain[0, 0], above.sum() / below.sum(), rtol=EXACT)


def test_a_hold_is_divided_out():
    period, omega = 1e-3, 2 * np.pi * FREQUENCY[FREQUENCY < 450]
    data = measured(NUMERATOR, DENOMINATOR, frequency=FREQUENCY[FREQUENCY < 450])
    hold = ((1 - np.exp(-1j * omega * period)) / (1j * omega * period))[:, None, None]
    held = replace(
        data,
        response=data.response * hold,
        variance=data.variance * np.abs(hold) ** 2,
        sampling_period_s=period,
        hold="zoh",
    )
    structure = ResponseFitOptions(poles=5, zeros=4, delay=0.0, integrators=0)
    fit, other = fit_response(held, structure), fit_response(data, structure)
    np.testing.assert_allclose(places(fit.poles), in_order(np.roots(DENOMINATOR)), rtol=EXACT)
    # Relative to the response, the deviation is that without the hold.
    for one, same in zip(fit.poles, other.poles, strict=True):
        np.testing.assert_allclose(one.real_std, same.real_std, rtol=1e-6)


def test_unknown_elements_do_not_count():
    data = measured(NUMERATOR, DENOMINATOR)
    response, variance = data.response.copy(), data.variance.copy()
    response[50:70], variance[50:70] = np.nan, np.inf
    fit = fit_response(
        replace(data, response=response, variance=variance), ResponseFitOptions(poles=5, zeros=4, delay=0.0)
    )
    np.testing.assert_allclose(places(fit.poles), in_order(np.roots(DENOMINATOR)), rtol=EXACT)
    assert fit.degrees_of_freedom == 2 * (len(FREQUENCY) - 20) - 10


def test_unstable_poles_are_found_unless_refused():
    below = np.convolve(polynomial((30, 0.02)), [1, -2 * np.pi * 5])
    data = measured(scaled(polynomial(real=(10,)), below), below, seed=1)
    assert not fit_response(data, ResponseFitOptions(poles=3)).is_stable
    assert fit_response(data, ResponseFitOptions(poles=3, stable=True)).is_stable


def test_structure_and_delay_are_chosen_by_evidence():
    fit = fit_response(measured(NUMERATOR, DENOMINATOR, delay=2e-3, seed=5))
    assert (fit.n_pole, len(fit.zeros[0][0]), fit.integrators) == (5, 4, 0)
    assert abs(fit.delay_s - 2e-3) < RECOVERY_SIGMA * fit.delay_std_s
    assert fit.tried[0].poles == 5
    assert list(fit.tried) == sorted(fit.tried, key=lambda one: one.score)


def test_variance_too_small_is_noticed():
    data = measured(NUMERATOR, DENOMINATOR, seed=2)
    fit = fit_response(replace(data, variance=data.variance / 9))
    assert fit.n_pole == 5
    assert fit.widened == pytest.approx(3, rel=0.1)
    assert fit.misfit_chance < 1e-6


def test_cost_of_the_right_structure_is_chi_square():
    costs, structure = [], ResponseFitOptions(poles=5, zeros=4, delay=0.0, integrators=0)
    for seed in range(40):
        fit = fit_response(measured(NUMERATOR, DENOMINATOR, seed=seed), structure)
        costs.append(fit.cost)
    assert fit.degrees_of_freedom == 2 * len(FREQUENCY) - 10
    assert kstest(costs, "chi2", args=(fit.degrees_of_freedom,)).pvalue > 1e-3


def test_deviations_are_those_of_repeated_measurements():
    structure = ResponseFitOptions(poles=5, zeros=4, integrators=0, max_delay_s=0.01)
    reference = fit_response(measured(NUMERATOR, DENOMINATOR, delay=2e-3), structure)
    fits = [again(reference, seed) for seed in range(150)]
    where = np.array([1.0, 8.1, 30.0, 60.2, 400.0])
    at = reference.response_at(where)
    spread = np.array([fit.response_at(where).response[:, 0, 0] for fit in fits])
    pairs = [
        (at.real_std[:, 0, 0], spread.real.std(axis=0)),
        (at.imaginary_std[:, 0, 0], spread.imag.std(axis=0)),
        ([reference.delay_std_s], [np.std([fit.delay_s for fit in fits])]),
        (reference.gain_std[0, 0], np.std([fit.gain[0, 0] for fit in fits])),
    ]
    for own in (lambda fit: fit.poles, lambda fit: fit.zeros[0][0]):
        found = np.array([places(own(fit)) for fit in fits])
        roots = sorted(own(reference), key=lambda root: (round(abs(root.place), 6), root.place.imag))
        pairs.append(([np.linalg.norm(root.moves.real) for root in roots], found.real.std(axis=0)))
        pairs.append(([np.linalg.norm(root.moves.imag) for root in roots], found.imag.std(axis=0)))
    # 150 draws know a deviation within 6 %.
    for predicted, seen in pairs:
        np.testing.assert_allclose(predicted, seen, rtol=0.25, atol=1e-9 * np.max(seen))


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_the_covariance_in_powers_gives_the_same_deviation(time):
    data = measured(NUMERATOR, DENOMINATOR, seed=3, sampling_period_s=0.9e-3)
    fit = fit_response(data, ResponseFitOptions(poles=5, zeros=4, time=time, integrators=0, delay=0.0))
    omega = 2 * np.pi * FREQUENCY
    s = 1j * omega / fit.reference if time == "continuous" else np.exp(1j * omega * 0.9e-3)
    n_power = fit.numerator.shape[2]
    above = s[:, None] ** np.arange(n_power - 1, -1, -1)
    below = s[:, None] ** np.arange(fit.n_pole, -1, -1)
    A = np.polyval(fit.denominator * fit.reference ** -np.arange(fit.n_pole + 1.0), s)
    G = fit.response_at(FREQUENCY).response[:, 0, 0]
    gradient = np.concatenate([above / A[:, None], -(G / A)[:, None] * below[:, 1:]], axis=1)
    moves = gradient @ fit.covariance_root[:-1]
    # A root of A moves by -dA / A', from the coefficients' covariance alone.
    scale = fit.reference if time == "continuous" else 1.0
    slopes = np.polyder(fit.denominator * fit.reference ** -np.arange(fit.n_pole + 1.0))
    for root in fit.poles:
        place = root.place / scale
        change = (
            place ** np.arange(fit.n_pole - 1, -1, -1) @ fit.covariance_root[n_power:-1] / np.polyval(slopes, place)
        )
        np.testing.assert_allclose(np.linalg.norm(change.real), np.linalg.norm(root.moves.real) / scale, rtol=1e-5)
    np.testing.assert_allclose(
        np.linalg.norm(moves.real, axis=1), fit.response_at(FREQUENCY).real_std[:, 0, 0], rtol=1e-5
    )


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"frequency_hz": np.linspace(0, 1, 200)}, "above zero"),
        ({"frequency_hz": np.ones(200)}, "once"),
        ({"variance": np.zeros((200, 1, 1))}, "above zero"),
        ({"variance": np.full((200, 1, 1), np.inf)}, "know each element"),
        ({"variance": np.ones((200, 1, 2))}, "shape"),
        ({"hold": "zoh"}, "sampling_period_s"),
    ],
)
def test_what_cannot_be_is_refused(change, match):
    with pytest.raises(ValueError, match=match):
        fit_response(replace(measured(NUMERATOR, DENOMINATOR), **change))


@pytest.mark.parametrize(
    "options",
    [
        ResponseFitOptions(time="discrete", relative_degree=-1),
        ResponseFitOptions(time="discrete", delay=0.5),
        ResponseFitOptions(poles=2, zeros=3),
        ResponseFitOptions(poles=1, integrators=2),
        ResponseFitOptions(time="discrete"),
    ],
)
def test_options_that_contradict_are_refused(options):
    with pytest.raises(ValueError, match="must"):
        fit_response(measured(NUMERATOR, DENOMINATOR), options)

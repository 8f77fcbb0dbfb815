import numpy as np
import pytest

from external_shots import CHANNELS, shot, sweep, transfer
from robid.models.external.fit.graphs import output_deviation, response_deviation
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.parameters import find_findings, poles_of, zeros_of
from robid.models.external.fit.problem import Structure
from tolerances import FINITE_DIFFERENCE, RECOVERY_SIGMA

MODEL = transfer([2.0, 3.0, 40.0], np.real(np.poly([-2.0, -5 + 6j, -5 - 6j])), delay=2, average=2)
ROOT = 1e-3 * np.random.default_rng(0).standard_normal((6, 9))
OMEGA = np.array([0.3, 4.0, 11.0])


def moved(column, step):
    """The model with its coefficients moved along a column of the covariance root."""
    change = step * ROOT[:, column]
    above = MODEL.numerator.ravel() + change[:3]
    return transfer(above, MODEL.denominator + np.concatenate([[0.0], change[3:]]), delay=2, average=2)


def slope(function, column, step=1e-3):
    return (function(moved(column, step)) - function(moved(column, -step))) / (2 * step)


def test_roots_move_as_finite_differences_say():
    poles = sorted(poles_of(MODEL, ROOT), key=lambda each: abs(each.place))
    assert [each.place for each in poles] == pytest.approx([-2.0, -5 + 6j])
    zero = zeros_of(MODEL, ROOT)[0]
    for column in range(ROOT.shape[1]):
        for each in poles:
            wanted = slope(lambda model, each=each: model.poles[np.argmin(np.abs(model.poles - each.place))], column)
            assert each.moves[column] == pytest.approx(wanted, rel=FINITE_DIFFERENCE)
        wanted = slope(lambda model: model.zeros()[np.argmax(model.zeros().imag)], column)
        assert zero.moves[column] == pytest.approx(wanted, rel=FINITE_DIFFERENCE)


@pytest.mark.parametrize("sampled", [False, True])
def test_deviation_of_the_response(sampled):
    def logarithm(model):
        return np.log((model.sampled_response if sampled else model.response)(OMEGA)[:, 0, 0])

    moves = np.stack([slope(logarithm, column) for column in range(ROOT.shape[1])], axis=1)
    found = response_deviation(MODEL, ROOT, OMEGA, sampled=sampled)
    np.testing.assert_allclose(found.magnitude[:, 0, 0], np.linalg.norm(moves.real, axis=1), rtol=FINITE_DIFFERENCE)
    np.testing.assert_allclose(found.phase_rad[:, 0, 0], np.linalg.norm(moves.imag, axis=1), rtol=FINITE_DIFFERENCE)


@pytest.mark.parametrize("start", ["rest", "periodic"])
def test_deviation_of_a_simulation(start):
    command = sweep(5.0, 300)[:, None]
    moves = [slope(lambda model: model.simulate(command, start), column) for column in range(ROOT.shape[1])]
    wanted = np.linalg.norm(moves, axis=0)
    np.testing.assert_allclose(output_deviation(MODEL, ROOT, command, start), wanted, atol=1e-6 * wanted.max())


def fitted(name):
    model = transfer(*CHANNELS[name], delay=4, average=4)
    levels = ((0.1, 0.6), (1.04, 0.05), (5.2, 0.002))
    shots = [
        shot(model, sweep(high, 4000, low_hz=0.01, amplitude=size), noise=5e-6, seed=seed)
        for seed, (high, size) in enumerate(levels)
    ]
    return fit_block(shots, [0], [0], Structure(len(model.poles), model.numerator.shape[-1] - 1, 4, 4))


def test_a_cancelling_pair_is_named():
    fit = fitted("Y")
    found = find_findings(fit.model, fit.covariance_root)
    assert len(found.pairs) == 1
    assert found.pairs[0] == pytest.approx((-3.14, -3.13), rel=0.1)
    assert "nearly cancel" in found.cancelling[0]
    apart = fitted("Z")
    assert not find_findings(apart.model, apart.covariance_root).pairs


def test_an_undershoot_is_flagged_and_a_pole_beyond_the_sampling_undetermined():
    fit = fitted("C")
    found = find_findings(fit.model, fit.covariance_root)
    assert found.significant == (True,)
    zero = zeros_of(fit.model, fit.covariance_root)[0]
    # It moves with the fast pole, of which the samples say little.
    assert abs(zero.place - 55.25) < RECOVERY_SIGMA * zero.real_std
    assert any("Nyquist" in each for each in found.undetermined)
    # What is not determined must not hide what is.
    assert fit.model.poles.real.max() == pytest.approx(-58.7, rel=0.02)


def test_a_zero_that_chance_may_have_put_there_is_not_significant():
    root = np.zeros((3, 1))
    root[0] = 5.0
    model = transfer([-0.1, 3.0], [1.0, 3.0])
    found = find_findings(model, root)
    assert found.significant == (False,)
    assert "not significantly" in found.non_minimum_phase[0]

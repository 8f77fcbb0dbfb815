import numpy as np
import pytest

from external_shots import CHANNELS, PERIOD_S, answer, shot, sweep, transfer
from robid.errors import DataError
from robid.models.external.fit.data import Shot
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure, first_noise, pose
from robid.models.external.fit.search import refine
from robid.models.external.fit.transfer import TransferMatrix
from tolerances import FINITE_DIFFERENCE, RECOVERY, RECOVERY_SIGMA

N_SAMPLE = 2000


def structure_of(model, **changes):
    known = {
        "poles": len(model.denominator) - 1,
        "zeros": model.numerator.shape[-1] - 1,
        "delay_samples": model.delay_samples,
        "moving_average": model.moving_average,
        "hold": model.hold,
    }
    return Structure(**(known | changes))


def true_parameters(model):
    return np.concatenate([model.numerator.ravel(), model.denominator[1:]])


def standardised(fit, model):
    return (fit.parameters - true_parameters(model)) / np.sqrt(np.diag(fit.covariance))


@pytest.mark.parametrize("name", ["Y", "Z"])
@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_recovery_without_noise(name, hold):
    model = transfer(*CHANNELS[name], delay=4, average=4, hold=hold)
    shots = [shot(model, sweep(1.0, N_SAMPLE)), shot(model, sweep(5.2, N_SAMPLE, amplitude=0.01))]
    fit = fit_block(shots, [0], [0], structure_of(model))
    np.testing.assert_allclose(fit.parameters, true_parameters(model), rtol=RECOVERY)
    assert fit.status == "converged"


def test_recovery_with_noise_and_resolution():
    model = transfer(*CHANNELS["Z"], delay=4, average=4)
    shots = [
        shot(model, sweep(1.0, N_SAMPLE), noise=1e-4, seed=1, resolution=1e-4),
        shot(model, sweep(5.2, N_SAMPLE, amplitude=0.1), noise=1e-4, seed=2, resolution=1e-4),
    ]
    fit = fit_block(shots, [0], [0], structure_of(model))
    assert np.abs(standardised(fit, model)).max() < RECOVERY_SIGMA
    assert (fit.whiteness > 1e-3).all()
    # Noise and half a step's rounding, from the residual alone.
    np.testing.assert_allclose(fit.noise_std, 1e-4 * np.sqrt(1 + 1 / 12), rtol=0.1)


def test_an_integrator_is_found():
    model = transfer([8.0], [1.0, 10.0, 0.0])
    fit = fit_block([shot(model, sweep(5.0, N_SAMPLE), noise=1e-4)], [0], [0], structure_of(model))
    slow = fit.model.poles[np.argmin(np.abs(fit.model.poles))]
    assert abs(slow) < 0.01
    assert np.abs(standardised(fit, model)).max() < RECOVERY_SIGMA


def test_free_start_and_offset_are_estimated_along():
    model = transfer(*CHANNELS["Z"], delay=2)
    long = shot(model, sweep(5.0, N_SAMPLE) + 1.0, noise=1e-4)
    cut = Shot(long.inputs[150:], long.outputs[150:] + 7.0, "free", None, 1, PERIOD_S, "cut", offset=True)
    # Two samples of what came before the cut are not known; what they did is a free response.
    fit = fit_block([cut], [0], [0], structure_of(model))
    assert np.abs(standardised(fit, model)).max() < RECOVERY_SIGMA
    at_rest = Shot(cut.inputs, cut.outputs, "rest", None, 1, PERIOD_S, "cut", offset=True)
    assert np.abs(standardised(fit_block([at_rest], [0], [0], structure_of(model)), model)).max() > RECOVERY_SIGMA


def test_a_steady_period():
    model = transfer(*CHANNELS["Z"], delay=2, average=3)
    command = np.random.default_rng(0).standard_normal(1024)
    twice = answer(model, np.tile(command, 6))[-1024:]
    noise = 1e-3 * np.random.default_rng(1).standard_normal(1024)
    period = Shot(command[:, None], (twice + noise)[:, None], "periodic", None, 1, PERIOD_S, "period", offset=True)
    fit = fit_block([period], [0], [0], structure_of(model))
    assert np.abs(standardised(fit, model)).max() < RECOVERY_SIGMA


def test_static_gain_one():
    model = transfer([20.0, 900.0], [1.0, 30.0, 900.0])
    measured = shot(model, sweep(5.0, N_SAMPLE), noise=1e-3)
    fit = fit_block([measured], [0], [0], structure_of(model, static_gain_one=True))
    assert fit.model.static_gain[0, 0] == pytest.approx(1.0, rel=1e-12)
    assert fit.n_free == 3
    gain = fit.parameters[1] / fit.parameters[-1]
    moves = (fit.covariance_root[1] - gain * fit.covariance_root[-1]) / fit.parameters[-1]
    assert np.linalg.norm(moves) < 1e-12
    assert np.abs(standardised(fit, model)).max() < RECOVERY_SIGMA


def test_unstable_poles_are_reflected_only_on_request():
    model = transfer([4.0], [1.0, 3.0, -0.2])
    measured = shot(model, sweep(3.0, 1500), noise=1e-3)
    free = fit_block([measured], [0], [0], structure_of(model, stable=False))
    assert not free.model.is_stable
    assert np.abs(standardised(free, model)).max() < RECOVERY_SIGMA
    kept = fit_block([measured], [0], [0], structure_of(model))
    assert kept.model.is_stable
    assert kept.reflected


def test_a_start_whose_signals_overflow_leads_nowhere():
    model = transfer([4.0], [1.0, 3.0, -0.2])
    problem = pose([shot(model, sweep(3.0, 1500), noise=1e-3)], [0], [0], structure_of(model, stable=False))
    denominator = np.poly([15.0 / problem.period, 10.0 / problem.period])
    noise = first_noise(problem.experiments)
    assert refine(problem, denominator, noise) == []


def test_common_poles_of_a_matrix():
    numerator = np.array([[[10.0, 300.0], [2.0, 5.0]], [[-3.0, 10.0], [20.0, 250.0]]])
    truth = TransferMatrix(("a", "b"), ("c", "d"), numerator, np.array([1.0, 20.0, 300.0]), 1, 1, PERIOD_S, "zoh")
    shots, rng = [], np.random.default_rng(0)
    for moved in range(2):
        commands = np.zeros((N_SAMPLE, 2))
        commands[:, moved] = sweep(6.0, N_SAMPLE)
        channels = [transfer(numerator[output, moved], truth.denominator, delay=1) for output in range(2)]
        told = np.stack([answer(each, commands[:, moved]) for each in channels], axis=1)
        shots.append(
            Shot(commands, told + 1e-3 * rng.standard_normal(told.shape), "rest", None, 1, PERIOD_S, "", False)
        )
    fit = fit_block(shots, [0, 1], [0, 1], structure_of(truth), names=(("a", "b"), ("c", "d")))
    assert np.abs(standardised(fit, truth)).max() < RECOVERY_SIGMA
    assert fit.model.outputs == ("c", "d")


def test_covariance_of_white_residuals_is_the_classical_one():
    model = transfer(*CHANNELS["Z"], delay=1)
    command = sweep(5.0, 1500)
    fit = fit_block([shot(model, command, noise=1e-3)], [0], [0], structure_of(model))
    assert fit.whiteness.min() > 0.01
    columns, found = [], fit.parameters
    for index, value in enumerate(found):
        step = 1e-5 * value
        ends = [found.copy(), found.copy()]
        ends[0][index] += step
        ends[1][index] -= step
        above, below = (answer(transfer(each[:2], [1.0, *each[2:]], delay=1), command) for each in ends)
        columns.append((above - below) / (2 * step))
    jacobian = np.stack(columns, axis=1)
    variance = np.sum(fit.residuals[0] ** 2) / (1500 - len(found))
    wanted = variance * np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(fit.covariance, wanted, rtol=100 * FINITE_DIFFERENCE)


def test_coloured_residuals_widen_the_covariance():
    model = transfer([30.0], [1.0, 30.0])
    command, rng = sweep(2.0, 4000), np.random.default_rng(3)
    slow = np.convolve(rng.standard_normal(4200), np.ones(200) / 200, "valid")[:4000]
    told = answer(model, command) + slow
    fit = fit_block(
        [Shot(command[:, None], told[:, None], "rest", None, 1, PERIOD_S, "", False)], [0], [0], structure_of(model)
    )
    assert fit.whiteness.max() < 1e-6
    white = shot(model, command, noise=float(slow.std()), seed=4)
    other = fit_block([white], [0], [0], structure_of(model))
    assert fit.covariance[0, 0] > 4 * other.covariance[0, 0]


def test_a_larger_order_never_fits_worse():
    model = transfer(*CHANNELS["Y"], delay=4, average=4)
    shots = [shot(model, sweep(5.2, N_SAMPLE), noise=1e-4)]
    costs = [fit_block(shots, [0], [0], Structure(n, n - 1, 4, 4)).log_likelihood for n in (1, 2, 3, 4)]
    assert np.all(np.diff(costs) > -1e-3)


@pytest.mark.parametrize(
    ("signals", "structure", "told"),
    [
        ((np.zeros((500, 1)), np.ones((500, 1))), Structure(1, 0), "input 0 does not move"),
        ((sweep(5.0, 500)[:, None], np.ones((500, 1))), Structure(1, 0), "output 0 does not move"),
        ((sweep(5.0, 20)[:, None], sweep(5.0, 20)[:, None]), Structure(4, 3), "too few"),
        ((sweep(5.0, 500)[:, None], np.full((500, 1), np.nan)), Structure(1, 0), "no numbers"),
        (
            (np.sin(np.arange(500) * 2 * np.pi / 50)[:, None], np.ones((500, 1)).cumsum(0)),
            Structure(4, 3),
            "frequencies",
        ),
    ],
)
def test_what_cannot_be_fitted_is_refused(signals, structure, told):
    bad = Shot(*signals, "rest", None, 1, PERIOD_S, "bad", offset=False)
    with pytest.raises(DataError, match=told) as caught:
        pose([bad], [0], [0], structure)
    assert caught.value.remedy

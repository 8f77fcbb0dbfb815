"""Every estimator in a noisy closed loop: bias and covariance against theory and against its own claim."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import exp1

from linear_loop import MOTORS, Loop, draw_reference, loop_record
from robid.frf.blocks import ESTIMATORS
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks

LINEAR = Loop(torque_noise=0.01, sensor_noise=3e-5)
NOISY = Loop(torque_noise=0.02, sensor_noise=6e-5)
CUBIC = Loop(torque_noise=3e-4, sensor_noise=1e-6, cubic=2000.0)
RMS = 1.0
RUNS = [60, pytest.param(500, marks=pytest.mark.slow)]


@dataclass(frozen=True)
class Outcome:
    """Responses (run, freq, out, in), their claimed variance, and mean noise and total covariances (freq, out, out)."""

    response: np.ndarray
    claimed: np.ndarray
    noise_only: np.ndarray
    noise: np.ndarray
    total: np.ndarray | None

    @property
    def variance(self):
        return self.response.var(axis=0, ddof=1)


def estimate_all(records, estimator, pooled_lines=3):
    frfs = [
        estimate_frf(r, EstimateOptions(estimator, compensation="none", pooled_lines=pooled_lines)) for r in records
    ]
    total = None if frfs[0].total_covariance is None else np.mean([frf.total_covariance[0] for frf in frfs], axis=0)
    return Outcome(
        np.array([frf.response[0] for frf in frfs]),
        np.mean([frf.element_variance()[0] for frf in frfs], axis=0),
        np.mean([frf.element_variance(noise_only=True)[0] for frf in frfs], axis=0),
        np.mean([frf.noise_covariance[0] for frf in frfs], axis=0),
        total,
    )


def play(loop, runs, realizations, periods, seed, *, same=True):
    """Records of many runs, all with the same reference or each with its own, and the reference's spectrum."""
    generator = np.random.default_rng(seed)
    spectrum, signal = draw_reference(generator, (realizations,) if same else (runs, realizations), RMS)
    reference = np.broadcast_to(signal, (runs, realizations, *signal.shape[-3:]))
    torque, angle = loop.simulate(reference, generator, periods=periods)
    return [loop_record(*each) for each in zip(reference, torque, angle, strict=True)], spectrum


def theory(loop, spectrum, periods, estimator):
    """First-order variance (freq, out, in) of a response and the bias of least squares, from the true noise."""
    torque = loop.torque_spectrum(spectrum)
    covariance, with_torque = loop.residual_noise(periods)
    realizations = len(torque)
    if estimator in ("arithmetic", "logarithmic"):
        weights = np.linalg.inv(torque) / realizations
    else:
        chosen = torque if estimator == "h1" else spectrum
        adjoint = np.swapaxes(chosen, -1, -2).conj()
        weights = adjoint @ np.linalg.inv((torque @ adjoint).sum(axis=0))
    factor = (np.abs(weights) ** 2).sum(axis=(0, 2))
    variance = np.real(np.diagonal(covariance, axis1=1, axis2=2))[:, :, None] * factor[:, None, :]
    power = (torque @ np.swapaxes(torque, -1, -2).conj()).sum(axis=0)
    # Of the experiments' mean noise product, the fit itself takes as many as it has inputs.
    bias = (realizations * MOTORS - MOTORS) * with_torque @ np.linalg.inv(power)
    return variance, bias


def projection(errors, direction, variance):
    """The mean error along a direction: in its own standard errors, and as a multiple of the direction."""
    weight = (direction / variance).conj()
    along = np.real(weight * errors).sum(axis=(1, 2, 3))
    return along.mean() / along.std(ddof=1) * np.sqrt(len(along)), along.mean() / np.real(weight * direction).sum()


def diagonal(covariance):
    return np.real(np.diagonal(covariance, axis1=1, axis2=2))


def show(title, rows):
    print(f"\n{title}")
    for name, *values in rows:
        print(f"{name:14s}" + "".join(f"{value:12.3f}" for value in values))


@pytest.mark.parametrize("runs", RUNS)
def test_covariance_with_four_realizations(runs):
    records, spectrum = play(LINEAR, runs, realizations=4, periods=2, seed=1)
    residual, _ = LINEAR.residual_noise(2)
    rows, slack = [], 0.6 / np.sqrt(runs)
    for name in (name for name in ESTIMATORS if name != "robust_local"):
        outcome, (variance, _) = estimate_all(records, name), theory(LINEAR, spectrum, 2, name)
        each = (outcome.variance / variance, outcome.claimed / variance, outcome.claimed / outcome.variance)
        noise, total = (diagonal(part) / diagonal(residual) for part in (outcome.noise, outcome.total))
        rows.append((name, *(ratio.mean() for ratio in (*each, noise, total))))
    show(f"{runs} runs, M = 4, P = 2: empirical/theory, claimed/theory, claimed/empirical, noise, total/theory", rows)
    for name, empirical, claimed, agreement, noise, total in rows:
        np.testing.assert_allclose(empirical, 1, atol=0.03 + slack, err_msg=name)
        np.testing.assert_allclose([claimed, agreement, total], 1, atol=0.1 + slack, err_msg=name)
        # With two periods the removal of drift passes noise that neither period's scatter shows.
        np.testing.assert_allclose(noise, 1, atol=0.15 + slack, err_msg=name)


@pytest.mark.parametrize("runs", RUNS)
def test_covariance_with_one_realization(runs):
    records, spectrum = play(LINEAR, runs, realizations=1, periods=4, seed=3)
    outcome, (variance, _) = estimate_all(records, "joint"), theory(LINEAR, spectrum, 4, "joint")
    residual, _ = LINEAR.residual_noise(4)
    ratios = (outcome.variance / variance, outcome.claimed / variance, outcome.claimed / outcome.variance)
    row = [ratio.mean() for ratio in (*ratios, diagonal(outcome.noise) / diagonal(residual))]
    show(
        f"{runs} runs, M = 1, P = 4: empirical/theory, claimed/theory, claimed/empirical, noise/theory", [("all", *row)]
    )
    np.testing.assert_allclose(row, 1, atol=0.1 + 0.6 / np.sqrt(runs))


@pytest.mark.parametrize("runs", RUNS)
def test_bias_of_least_squares_is_seen_and_that_of_the_instrument_is_not(runs):
    records, spectrum = play(NOISY, runs, realizations=4, periods=2, seed=2)
    variance, bias = theory(NOISY, spectrum, 2, "h1")
    names = ("arithmetic", "joint", "indirect", "h1")
    error = {name: estimate_all(records, name).response - NOISY.response() for name in names}
    seen = {name: projection(each, bias, variance) for name, each in error.items()}
    # Both share most of the noise: their difference shows the bias far more sharply than either.
    seen["h1 - joint"] = projection(error["h1"] - error["joint"], bias, variance)
    show(
        f"{runs} runs, bias along theory's for least squares: standard errors, multiple",
        [(k, *v) for k, v in seen.items()],
    )
    assert seen["h1"][0] > 10 * np.sqrt(runs / 500)
    assert all(abs(seen[name][0]) < 4 for name in names[:3])
    np.testing.assert_allclose(seen["h1 - joint"][1], 1, atol=0.1)


@pytest.mark.parametrize("runs", RUNS)
def test_total_covariance_holds_the_distortion_and_more_periods_never_reduce_it(runs):
    few, _ = play(CUBIC, runs, realizations=4, periods=2, seed=4, same=False)
    many, _ = play(CUBIC, runs, realizations=4, periods=8, seed=4, same=False)
    rows = []
    for name in ("logarithmic", "joint"):
        short, long = estimate_all(few, name), estimate_all(many, name)
        ratios = (
            short.variance / short.claimed,
            long.variance / long.claimed,
            long.claimed / short.claimed,
            long.noise_only / short.noise_only,
            short.noise_only / short.claimed,
        )
        rows.append((name, *(ratio.mean() for ratio in ratios)))
    show(f"{runs} runs, cubic sensor: empirical/claimed P = 2 and 8, total and noise P = 8 over 2, noise/total", rows)
    for name, agreement, again, total, noise, share in rows:
        np.testing.assert_allclose([agreement, again], 1, atol=0.1 + 0.6 / np.sqrt(runs), err_msg=name)
        np.testing.assert_allclose(total, 1, atol=0.03, err_msg=name)
        assert noise < 0.3, name
        assert share < 0.05, name


def test_bias_of_the_means_at_low_signal_to_noise_ratio():
    # One input: a complex Gaussian in the quotient's denominator has closed-form means.
    generator, draws, torque, acceleration, feedback = np.random.default_rng(5), 200_000, 1.0, 3.0 - 1.0j, -0.4 + 0.3j
    white = (generator.standard_normal((2, 2, draws)) + 1j * generator.standard_normal((2, 2, draws))) / np.sqrt(2)
    torque_noise = np.sqrt(0.4) * white[0]
    acceleration_noise = feedback * torque_noise + 1.5 * white[1]
    blocks = Blocks(
        lines=np.arange(draws),
        inputs=(torque + torque_noise)[:, :, None, None],
        outputs=(acceleration + acceleration_noise)[:, :, None, None],
        reference=None,
        input_scatter=np.zeros((2, 0, draws, 1, 1), complex),
        output_scatter=np.zeros((2, 0, draws, 1, 1), complex),
        scatter_freedom=0,
    )
    mean = ESTIMATORS["arithmetic"](blocks).response.ravel()
    wanted = acceleration + (feedback - acceleration) * np.exp(-1 / 0.4)
    assert abs(mean.mean() - wanted) < 4 * mean.std() / np.sqrt(draws)
    assert abs(acceleration - wanted) > 10 * mean.std() / np.sqrt(draws)
    size = np.log(np.abs(ESTIMATORS["logarithmic"](blocks).response.ravel()))
    power = np.abs(feedback) ** 2 * 0.4 + 1.5**2
    offset = 0.5 * exp1(np.abs(acceleration) ** 2 / power) - 0.5 * exp1(1 / 0.4)
    assert abs(size.mean() - np.log(np.abs(acceleration)) - offset) < 4 * size.std() / np.sqrt(draws)
    assert abs(offset) > 5 * size.std() / np.sqrt(draws)

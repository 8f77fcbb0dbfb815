"""The crest reduction: gradients, peaks between samples, its result against random draws and Schroeder's phases."""

import numpy as np
import pytest
from scipy.optimize import check_grad

from robid.design.excitation.lines import choose_lines
from robid.design.excitation.options import MultisineOptions
from robid.signals.crest import _BlockNorm, _CopiesNorm, _TurnedNorm, reduce_crest, reduce_crest_with_motion
from robid.signals.waveforms import crest_factor, multisine, orthogonal_matrix, time_signal

LINES = np.array([11, 13, 15, 17, 21, 25, 31, 37, 45, 55, 67, 81])
ODD_AND_FULL = pytest.mark.parametrize("lines", [LINES, np.array([3, 4, 8, 9, 14])], ids=["odd", "full"])


def crest_of(phases, lines, shifts=(0.0,), per_period=8):
    """Crest factor of a flat multisine and its copies at so many samples of the highest line's period."""
    copies = np.exp(1j * (phases + np.asarray(shifts)[:, None]))[:, :, None]
    return crest_factor(time_signal(copies, lines, per_period * int(lines.max()))).max()


def random_response(n_lines, n_out, n_motor):
    parts = np.random.default_rng(8).normal(size=(2, n_lines, n_out, n_motor))
    return parts[0] + 1j * parts[1]


@ODD_AND_FULL
def test_gradient_and_peak_over_shifted_copies(lines):
    generator = np.random.default_rng(3)
    phases = generator.uniform(0, 6, len(lines))
    shifts = 2 * np.pi * 2 * np.arange(6) / 6
    amplitudes = generator.uniform(0.5, 2, len(lines))
    norm = _CopiesNorm(amplitudes, lines, shifts)
    error = check_grad(lambda x: norm(x, 4)[0], lambda x: norm(x, 4)[1], phases, epsilon=1e-7)
    assert error < 1e-5 * np.linalg.norm(norm(phases, 4)[1])
    copies = amplitudes * np.exp(1j * (phases + shifts[:, None]))
    fine = time_signal(copies[:, :, None], lines, 16384)
    assert norm.peak(phases) == pytest.approx(crest_factor(fine).max(), rel=0.01)


@ODD_AND_FULL
def test_gradient_and_peak_over_references_and_motion(lines):
    generator = np.random.default_rng(4)
    amplitudes = generator.uniform(0.5, 2, (3, len(lines)))
    phases = generator.uniform(0, 6, (3, len(lines)))
    response = random_response(len(lines), 2, 3)
    norm = _BlockNorm(amplitudes, lines, response)
    gradient = norm(phases.ravel(), 3)[1]
    error = check_grad(lambda x: norm(x, 3)[0], lambda x: norm(x, 3)[1], phases.ravel(), epsilon=1e-7)
    assert error < 1e-5 * np.linalg.norm(gradient)
    spectrum = multisine(amplitudes, phases[None])[0]
    both = [time_signal(each, lines, 16384) for each in (spectrum, np.einsum("koi,eki->eko", response, spectrum))]
    peaks = [np.abs(each).max(axis=1) / np.sqrt(np.mean(each**2, axis=(0, 1))) for each in both]
    assert norm.peak(phases.ravel()) == pytest.approx(max(each.max() for each in peaks), rel=0.01)


def test_gradients_over_experiments_with_phases_of_their_own():
    generator = np.random.default_rng(9)
    amplitudes = generator.uniform(0.5, 2, (3, len(LINES)))
    phases, turn = generator.uniform(0, 6, (2, 3, len(LINES)))
    shifts = np.angle(orthogonal_matrix(3))[1][:, None] + turn
    one = _TurnedNorm(amplitudes[1], LINES, shifts)
    error = check_grad(lambda x: one(x, 3)[0], lambda x: one(x, 3)[1], phases[1], epsilon=1e-7)
    assert error < 1e-5 * np.linalg.norm(one(phases[1], 3)[1])
    block = _BlockNorm(amplitudes, LINES, random_response(len(LINES), 2, 3), turn)
    error = check_grad(lambda x: block(x, 3)[0], lambda x: block(x, 3)[1], phases.ravel(), epsilon=1e-7)
    assert error < 1e-5 * np.linalg.norm(block(phases.ravel(), 3)[1])
    played = time_signal(multisine(amplitudes, phases[None], turn[None])[0], LINES, 16384)
    assert one.peak(phases[1]) == pytest.approx(crest_factor(played)[:, 1].max(), rel=0.01)


def test_one_signal_beats_random_draws_and_schroeder():
    lines, _ = choose_lines(MultisineOptions(), 1e-3)
    generator = np.random.default_rng(5)
    draws = [crest_of(phases, lines) for phases in generator.uniform(0, 2 * np.pi, (100, len(lines)))]
    index = np.arange(len(lines))
    schroeder = crest_of(-np.pi * index * (index + 1) / len(lines), lines)
    starts = generator.uniform(0, 2 * np.pi, (8, len(lines)))
    ends = [reduce_crest(start, np.ones(len(lines)), lines, np.zeros(1), iterations=60) for start in starts]
    best, crest = min(ends, key=lambda end: end[1])
    assert crest == pytest.approx(crest_of(best, lines, per_period=64), rel=0.01)
    assert crest_of(best, lines) < 1.62
    assert crest_of(best, lines, per_period=64) < 1.63
    assert min(draws) > 2.4
    assert schroeder > 3.0


@pytest.mark.parametrize("size", [4, 6])
def test_crest_factor_of_a_whole_block_falls(size):
    lines, _ = choose_lines(MultisineOptions(), 1e-3)
    shifts = np.angle(orthogonal_matrix(size)[1])
    start = np.random.default_rng(4).uniform(0, 2 * np.pi, len(lines))
    best, _ = reduce_crest(start, np.ones(len(lines)), lines, shifts, iterations=60)
    assert crest_of(start, lines, shifts) > 2.5
    assert crest_of(best, lines, shifts) < 1.86


def test_motion_through_a_resonance_is_flattened_with_the_reference():
    lines = 2 * np.arange(5, 45) + 1
    ratio = lines / 40
    gain = 1 / (1 - ratio**2 + 0.1j * ratio)
    response = np.stack([np.stack([gain, 0.3 * gain], -1), np.stack([-0.2 * gain, 1 + 0 * gain], -1)], axis=1)
    start = np.random.default_rng(9).uniform(0, 2 * np.pi, (2, len(lines)))
    amplitude = np.ones((2, len(lines)))

    def crests(phases):
        spectrum = multisine(amplitude, phases[None])[0]
        motion = np.einsum("koi,eki->eko", response, spectrum)
        return [crest_factor(time_signal(each, lines, 2000)).max() for each in (spectrum, motion)]

    before, after = crests(start), crests(reduce_crest_with_motion(start, amplitude, lines, response, iterations=60))
    assert min(before) > 2.4
    assert max(after) < 2.1


def test_no_iterations_keep_the_random_phases():
    starts = np.random.default_rng(5).uniform(0, 6, (2, len(LINES)))
    np.testing.assert_array_equal(reduce_crest(starts[0], np.ones(12), LINES, np.zeros(1), iterations=0)[0], starts[0])
    same = reduce_crest_with_motion(starts, np.ones((2, 12)), LINES, random_response(12, 2, 2), iterations=0)
    np.testing.assert_array_equal(same, starts)

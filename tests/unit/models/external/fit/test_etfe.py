"""The empirical response: its radius holds the true one, bands are merged, transients and other commands are told."""

import numpy as np
import pytest
from scipy import signal

from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import estimate_etfe, floors, moved_inputs, together
from robid.signals.waveforms import chirp

PERIOD_S, N_SAMPLE, DELAY = 0.012, 4000, 3
NUMERATOR, DENOMINATOR = ([24.08, 1362.0], [1.0, 65.0, 1362.0])
DISCRETE = signal.cont2discrete((NUMERATOR, DENOMINATOR), PERIOD_S, method="zoh")
RESOLUTION = np.array([1e-5])


def answer(command):
    moved = signal.lfilter(DISCRETE[0][0], DISCRETE[1], command)
    return np.concatenate([np.zeros(DELAY), moved[:-DELAY]])


def truth(frequency_hz):
    z = np.exp(2j * np.pi * frequency_hz * PERIOD_S)
    return np.polyval(DISCRETE[0][0], z) / np.polyval(DISCRETE[1], z) * z ** -float(DELAY)


def chirp_shot(band_hz, amplitude, seed, noise=1e-5):
    command = amplitude * chirp(0.01 * PERIOD_S, band_hz * PERIOD_S, N_SAMPLE, peak=0.0)
    measured = answer(command) + noise * np.random.default_rng([seed, int(100 * band_hz)]).standard_normal(N_SAMPLE)
    return Shot(command[:, None], measured[:, None], "free", None, 1, PERIOD_S, f"{band_hz} Hz")


def test_the_radius_holds_the_true_response_as_often_as_it_says():
    inside = []
    for seed in range(20):
        shots = [chirp_shot(band, size, seed) for band, size in ((0.1, 0.6), (1.04, 0.05), (5.2, 0.002))]
        etfe = estimate_etfe(shots, floors(shots, RESOLUTION), 0.95)
        inside.append(np.abs(etfe.response[:, 0, 0] - truth(etfe.frequency_hz)) < etfe.radius[:, 0, 0])
    # Merging by estimated variances costs a little.
    assert 0.91 < np.concatenate(inside).mean() < 0.98


def test_bands_are_merged_into_one_curve_by_what_each_knows():
    slow, fast = chirp_shot(0.5, 0.05, 1), chirp_shot(5.2, 0.002, 2)
    floor = floors([slow, fast], RESOLUTION)
    both, one = estimate_etfe([slow, fast], floor, 0.95), estimate_etfe([slow], floor, 0.95)
    assert one.frequency_hz[-1] < 1 < 4 < both.frequency_hz[-1]
    assert np.diff(both.frequency_hz).min() > 0
    own = np.isin(both.frequency_hz.round(9), one.frequency_hz.round(9))
    again = np.isin(one.frequency_hz.round(9), both.frequency_hz.round(9))
    # The slow chirp knows low frequencies 25 times better.
    assert np.median(both.radius[own, 0, 0] / one.radius[again, 0, 0]) == pytest.approx(1, abs=0.1)


def test_what_is_not_excited_is_not_in_it():
    shot = chirp_shot(1.04, 0.002, 3)
    etfe = estimate_etfe([shot], floors([shot], RESOLUTION), 0.95)
    assert etfe.frequency_hz[-1] < 1.5
    amplitude = 2 / N_SAMPLE * np.abs(np.fft.rfft(shot.inputs[:, 0]))
    high = np.fft.rfftfreq(N_SAMPLE, PERIOD_S)[np.flatnonzero(amplitude > RESOLUTION)[-1]]
    assert etfe.frequency_hz[-1] <= high


def test_a_transient_is_not_taken_for_a_response():
    shot = chirp_shot(5.2, 0.002, 4, noise=1e-8)
    ringing = 5e-4 * np.exp(-2 * PERIOD_S * np.arange(N_SAMPLE))
    shot = Shot(shot.inputs, shot.outputs + ringing[:, None], "free", None, 1, PERIOD_S, "after a motion")
    etfe = estimate_etfe([shot], floors([shot], RESOLUTION), 0.95)
    error = np.abs(etfe.response[:, 0, 0] - truth(etfe.frequency_hz))
    assert np.median(error) < 2e-3
    plain = np.fft.rfft(shot.outputs[:, 0]) / np.fft.rfft(shot.inputs[:, 0])
    line = 120
    assert abs(plain[line] - truth(np.array([line / N_SAMPLE / PERIOD_S]))[0]) > 2e-2


def test_commands_that_move_together_need_as_many_experiments():
    generator = np.random.default_rng(5)
    lines = np.arange(1, 400, 2)
    shots = []
    for _ in range(2):
        spectra = np.zeros((2001, 2), complex)
        spectra[lines] = np.exp(2j * np.pi * generator.random((lines.size, 2)))
        inputs = np.fft.irfft(spectra, axis=0)
        outputs = answer(np.tile(inputs[:, 0], 3))[-4000:] - 0.3 * inputs[:, 1]
        shots.append(Shot(inputs, outputs[:, None], "periodic", None, 1, PERIOD_S, "both", place="home"))
    floor = np.full(2, 1e-6)
    assert [len(group) for group in together(shots, floor)] == [2]
    assert moved_inputs(shots[0], floor).all()
    etfe = estimate_etfe(shots, floor, 0.95)
    np.testing.assert_allclose(etfe.response[:, 0, 0], truth(etfe.frequency_hz), atol=2e-4)
    np.testing.assert_allclose(etfe.response[:, 0, 1], -0.3, atol=2e-4)

"""Which lines of a log are excited: those that were stated, or those that the data show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robid.design.excitation.lines import choose_lines
from robid.design.excitation.options import MultisineOptions
from robid.logs.period import band_of, check_found, check_lines, find_lines, found_note, is_found_note

N_SAMPLE = 2000
BAND = np.arange(2, 400)


def periods(amplitude, *, noise=0.0, count=5, seed=1):
    """Periods (count, n_sample) of a signal whose lines have these amplitudes."""
    generator = np.random.default_rng(seed)
    spectrum = np.zeros(N_SAMPLE // 2 + 1, complex)
    for line, size in amplitude.items():
        spectrum[line] = size * np.exp(2j * np.pi * generator.random())
    signal = np.fft.irfft(spectrum, norm="forward")
    return signal + noise * generator.standard_normal((count, N_SAMPLE))


def flat(lines, size=1.0):
    return dict.fromkeys(np.asarray(lines).tolist(), size)


@pytest.mark.parametrize("lines", [np.arange(11, 251), np.arange(11, 251, 2), np.array([12, 30, 31, 77, 201])])
def test_lines_that_stand_out_are_found(lines):
    np.testing.assert_array_equal(find_lines([periods(flat(lines), noise=0.5)], BAND), lines)


def test_distortion_that_repeats_is_not_meant():
    lines = np.arange(11, 251, 2)
    generator = np.random.default_rng(5)
    distortion = {line: 0.05 * generator.rayleigh() for line in range(2, 400)}
    signal = periods(distortion | flat(lines), noise=1e-3)
    np.testing.assert_array_equal(find_lines([signal], BAND), lines)


@pytest.mark.parametrize("lines", [np.array([12, 30, 31, 77]), np.array([12, 30, 31, 77, 201, 220, 230, 300])])
def test_a_few_lines_stand_out_of_distortion_at_all_others(lines):
    generator = np.random.default_rng(5)
    distortion = {line: 0.03 * generator.rayleigh() for line in range(2, 400)}
    np.testing.assert_array_equal(find_lines([periods(distortion | flat(lines), noise=1e-3)], BAND), lines)


def test_one_strong_line_is_no_kind_of_its_own():
    lines = np.array([4, 20, 40, 60, 80, 100])
    found = find_lines([periods({4: 30.0} | flat(lines[1:]), noise=1e-3)], BAND)
    np.testing.assert_array_equal(found, lines)


def test_lines_of_one_kind_are_all_meant():
    generator = np.random.default_rng(6)
    noise_like = {line: generator.rayleigh() for line in range(2, 400)}
    found = find_lines([periods(noise_like, noise=1e-3)], BAND)
    assert len(found) > 0.95 * len(BAND)
    np.testing.assert_array_equal(find_lines([periods({line: 40 / line for line in BAND}, noise=1e-4)], BAND), BAND)


def test_one_period_and_several_inputs():
    first, second = np.arange(11, 100, 2), np.arange(12, 100, 2)
    signals = [periods(flat(lines), noise=0.1, count=1) for lines in (first, second)]
    np.testing.assert_array_equal(find_lines(signals, BAND), np.arange(11, 100))
    assert find_lines([np.zeros((3, N_SAMPLE))], BAND).size == 0


def test_noise_alone_shows_no_line():
    found = find_lines([periods({}, noise=1.0)], BAND)
    assert len(found) < 4
    (problem,) = check_found("log.mat", found, BAND)
    assert "4 are needed" in str(problem)
    assert "`arbitrary`" in str(problem)
    assert not check_found("log.mat", BAND[:4], BAND)


def test_what_was_found_is_told():
    note = found_note(np.arange(11, 251), 398)
    assert is_found_note(note)
    assert "11-250, 240 of 398" in note


def test_white_noise_carries_every_line_that_was_stated():
    """A notch here and there is what noise has, and a part of its band is what one may ask for."""
    noise = np.random.default_rng(7).standard_normal((1, 20_000))
    assert check_lines("log.mat", noise, np.arange(40, 400)) == []
    assert check_lines("log.mat", noise, np.arange(1, 9_999)) == []


def test_single_silent_lines_are_no_refusal_and_wrong_bands_are():
    signal = periods(flat(np.arange(11, 251)), noise=0.01)
    assert check_lines("log.mat", signal, np.arange(11, 300)) == []
    (problem,) = check_lines("log.mat", signal, np.arange(301, 399))
    assert "0 of 98 carry some" in str(problem)
    assert "The energy is at lines 11-250" in str(problem)


@given(
    period_s=st.floats(1e-3, 2e3),
    first=st.integers(1, 300),
    count=st.integers(2, 4000),
)
def test_a_band_that_is_printed_holds_its_lines_and_no_others(period_s, first, count):
    period_s = float(f"{period_s:.9g}")
    last = first + count - 1
    low, high = (float(f"{end:.9g}") for end in band_of(first, last, period_s))
    options = MultisineOptions(period_s=period_s, low_hz=low, high_hz=high, lines="all", grid="full")
    lines, _ = choose_lines(options, period_s / (3 * last + 3))
    assert lines[0] == first
    assert lines[-1] == last

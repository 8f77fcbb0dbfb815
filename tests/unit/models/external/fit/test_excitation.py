"""What a page shows of commands and outputs: their course and their spectra, each in the shots that move it."""

import numpy as np
import pytest

from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import OwnChannel, show_excitation

STEP, N = 0.01, 5000
TIME = STEP * np.arange(N)
FLOOR = np.array([1e-6, 1e-6])


def shot_of(amplitudes, name):
    inputs = np.stack([size * np.sin(2 * np.pi * 2.0 * TIME) for size in amplitudes], axis=1)
    return Shot(inputs + 3.0, 0.5 * inputs - 1.0, "periodic", None, 1, STEP, name)


@pytest.fixture
def found():
    shots = (shot_of((0.2, 0.0), "first"), shot_of((0.0, 0.4), "second"), shot_of((0.1, 0.3), "third"))
    channels = (OwnChannel("X", 0, 0), OwnChannel("A", 1, 1))
    return show_excitation(shots, channels, FLOOR, np.array([1e-5, 2e-5]), np.array([3e-5, 4e-5]))


def test_each_command_is_shown_in_the_shots_that_move_it(found):
    pairs = set(zip(found.time_channel.tolist(), found.time_shot.tolist(), strict=True))
    assert pairs == {(0, 0), (1, 1), (0, 2), (1, 2)}
    assert found.shots == ("first", "second", "third")
    np.testing.assert_array_equal(found.answer_resolution, [3e-5, 4e-5])


def test_courses_have_no_offset_and_are_thinned_not_shifted(found):
    rows = (found.time_channel == 1) & (found.time_shot == 1)
    assert 1000 < rows.sum() <= 2000
    np.testing.assert_allclose(found.command[rows], 3.0 + 0.4 * np.sin(4 * np.pi * found.time_s[rows]), atol=1e-12)
    np.testing.assert_allclose(found.answer[rows], 0.2 * np.sin(4 * np.pi * found.time_s[rows]), atol=1e-12)


def test_spectra_show_the_amplitude_of_a_sine_where_it_is(found):
    rows = (found.line_channel == 0) & (found.line_shot == 0)
    frequency, size = found.frequency_hz[rows], found.command_amplitude[rows]
    assert np.all(np.diff(frequency) > 0)
    assert frequency[-1] == pytest.approx(0.5 / STEP, rel=0.04)
    at = np.argmax(size)
    assert size[at] == pytest.approx(0.2, rel=1e-9)
    assert frequency[at] == pytest.approx(2.0, rel=0.04)
    assert found.answer_amplitude[rows][at] == pytest.approx(0.1, rel=1e-9)
    assert np.delete(size, at).max() < 1e-9


def test_a_command_that_never_moves_has_no_rows():
    channels = (OwnChannel("X", 0, 0), OwnChannel("A", 1, 1))
    found = show_excitation((shot_of((0.2, 0.0), "only"),), channels, FLOOR, np.ones(2), np.ones(2))
    assert set(found.time_channel.tolist()) == set(found.line_channel.tolist()) == {0}

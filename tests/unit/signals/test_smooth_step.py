"""The smooth step: its ends, its limits, and that its rows are each other's derivatives."""

import numpy as np
import pytest

from robid.signals.waveforms import PEAK_ACCELERATION, PEAK_SNAP, smooth_step, step_duration_s
from tolerances import FINITE_DIFFERENCE, IDENTITY

SPEED, RAMP = 2.0, 0.3


@pytest.mark.parametrize("size", [1.0, -1.0, 0.1])
def test_it_goes_where_it_should_in_its_time(size):
    duration = step_duration_s(size, SPEED, RAMP)
    position, speed, acceleration = smooth_step(np.array([-1.0, 0.0, duration, duration + 3.0]), size, SPEED, RAMP)
    np.testing.assert_allclose(position, [0.0, 0.0, size, size], atol=IDENTITY)
    np.testing.assert_allclose([speed, acceleration], 0.0, atol=1e-9)


def test_rows_are_derivatives_of_each_other():
    time = np.linspace(-0.1, 1.0, 2201)
    step = time[1] - time[0]
    position, speed, acceleration = smooth_step(time, 1.0, SPEED, RAMP)
    for upper, lower in ((position, speed), (speed, acceleration)):
        slope = (upper[2:] - upper[:-2]) / (2 * step)
        np.testing.assert_allclose(slope, lower[1:-1], atol=100 * FINITE_DIFFERENCE * np.abs(lower).max())
    assert speed.max() == pytest.approx(SPEED, rel=IDENTITY)


def test_peaks_are_as_stated():
    time = np.linspace(0, RAMP, 3001)
    acceleration = smooth_step(time, 10.0, SPEED, RAMP)[2]
    assert acceleration.max() == pytest.approx(PEAK_ACCELERATION * SPEED / RAMP, rel=1e-6)
    snap = np.diff(acceleration, 2) / (time[1] - time[0]) ** 2
    assert np.abs(snap).max() == pytest.approx(PEAK_SNAP * SPEED / RAMP**3, rel=1e-3)

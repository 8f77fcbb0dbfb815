"""How much of another signal's derivative a signal is: by the transfer function, not by a ratio of noises."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from robid.logs.inspection.relations import relate_signals, sense_of_loss, spectrum_of

STEP = 1e-3
RNG = np.random.default_rng(11)


def slow(duration):
    """A trajectory of few periods on a slope, and its derivative."""
    time = np.arange(0, duration, STEP)
    angle = 0.5 * time + np.sin(2 * np.pi * 0.3 * time) + 0.2 * np.cos(2 * np.pi * 0.9 * time)
    speed = 0.5 + 0.6 * np.pi * np.cos(2 * np.pi * 0.3 * time) - 0.36 * np.pi * np.sin(2 * np.pi * 0.9 * time)
    return angle, speed


def fast(corner=0.05):
    speed = sosfilt(butter(4, corner, output="sos"), RNG.normal(size=12_000))
    return lfilter([STEP / 2, STEP / 2], [1, -1], speed), speed


@pytest.mark.parametrize("unit", [1.0, 180 / np.pi, -30 / np.pi])
@pytest.mark.parametrize("duration", [2, 5, 20])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_motion_of_few_periods_tells_its_factor_in_spite_of_noise(unit, duration, noise):
    angle, speed = slow(duration)
    found = relate_signals(angle + noise * RNG.normal(size=len(angle)), unit * speed, 1, STEP)
    assert found.factor == pytest.approx(unit, rel=2e-3)
    assert abs(found.factor / unit - 1) < 4 * found.relative_std < 0.02
    assert found.carried > 0.9


@pytest.mark.parametrize("made", ["difference", "filtered", "quantised", "noisy"])
def test_a_speed_from_samples_or_behind_a_filter_tells_its_factor(made):
    angle, speed = fast()
    if made == "difference":
        speed = np.diff(angle, prepend=angle[0]) / STEP
    elif made == "filtered":
        speed = sosfilt(butter(1, 0.05, output="sos"), speed)
    elif made == "quantised":
        step = 0.02 * angle.std()
        angle = step * np.round(angle / step)
    else:
        angle = angle + 0.01 * angle.std() * RNG.normal(size=len(angle))
        speed = speed + 0.1 * speed.std() * RNG.normal(size=len(angle))
    found = relate_signals(angle, speed, 1, STEP)
    assert found.factor == pytest.approx(1, abs=max(0.005, 4 * found.relative_std))
    assert found.relative_std < 0.02


def test_an_acceleration_and_a_ratio_are_told_too():
    angle, speed = fast()
    acceleration = np.gradient(speed, STEP)
    assert relate_signals(angle, acceleration, 2, STEP).factor == pytest.approx(1, rel=5e-3)
    assert relate_signals(angle, -121.5 * angle + 3, 0, STEP).factor == pytest.approx(-121.5, rel=1e-3)


def test_signals_without_a_relation_tell_none():
    angle, _ = fast()
    _, other = fast()
    found = relate_signals(angle, other, 1, STEP)
    assert found is None or found.carried < 0.1
    assert relate_signals(np.zeros(5000), np.zeros(5000), 1, STEP) is None


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("order", [0, 1])
def test_work_that_friction_takes_tells_a_sign_whatever_other_joints_do(sign, order):
    angle, speed = slow(20)
    acceleration, other = np.gradient(speed, STEP), np.sin(2 * np.pi * 0.5 * STEP * np.arange(len(angle)))
    # What another joint does outweighs this one's inertia and goes against it.
    torque = -0.5 * acceleration + 3 * speed + other
    motion = sign * (angle if order else speed)
    found = sense_of_loss(spectrum_of(torque, STEP), spectrum_of(motion, STEP), order)
    assert found * sign > 0.5
    lossless = sense_of_loss(spectrum_of(acceleration - 2 * angle, STEP), spectrum_of(motion, STEP), order)
    assert abs(lossless) < 0.05

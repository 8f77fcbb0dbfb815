"""Torque laws from silent lines: records that obey a law exactly, what cannot be told, and the derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.compensation import disturbance, record_motion
from robid.frf.estimate import estimate_frf
from robid.frf.laws import combine_laws
from robid.frf.options import EstimateOptions
from robid.frf.silent import identify_laws, start_laws
from robid.frf.spectra import line_amplitudes, record_blocks
from robid.robot.friction import KINDS, LAWS, LUGRE, TorqueLaw
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal

PERIOD_S, N_SAMPLE = 2.0, 2000
SAMPLING_S = PERIOD_S / N_SAMPLE
EXCITED = np.arange(5, 80, 4)
BAND = np.arange(5, 78)
MOTORS, REALIZATIONS = 2, 2
DELAY_S = 0.7 * SAMPLING_S
NAMES = ("first", "second")
BRISTLE = TorqueLaw(0.6, 0.75, 3.0, 0.03, 0.1, 0.05, 4, lag_samples=0.3, ripple_sin=-0.8, ripple_cos=0.5)
CURVE = TorqueLaw(0.4, 0.45, 4.0, 0.8, 0.1, 0.0, 4, LAWS["stribeck"])
UNKNOWN = tuple(replace(law, coulomb_nm=0.0, static_nm=0.0) for law in (BRISTLE, CURVE))


def inverse_response(lines):
    """Inverse of two coupled masses' response, with a locked mode inside the band (n_line, 2, 2)."""
    s = 2j * np.pi * lines[:, None, None] / PERIOD_S
    inertia, coupling = np.array([[0.02, 0.004], [0.004, 0.01]]), np.array([[0.012, -0.004], [-0.004, 0.008]])
    return inertia + coupling * (400 + 2 * s) / (s**2 + 2 * s + 400)


def whole_torque(record, lines, laws):
    """Torque (n_real, n_line, n_in, n_exp) of laws that act beside each other."""
    motion = record_motion(record, lines, DELAY_S)
    return sum(disturbance(motion, each).torque for each in laws)


def make_record(laws, *further, noise=0.0, unexplained=0.0, seed=0):
    """Any motion, and the torque command that makes the robot with these laws, one beside the other, move so."""
    generator = np.random.default_rng(seed)
    phases = generator.uniform(0, 2 * np.pi, (REALIZATIONS, MOTORS, EXCITED.size))
    moved = np.zeros((REALIZATIONS, MOTORS, BAND.size, MOTORS), complex)
    level = 8.0 * np.ones((MOTORS, EXCITED.size))
    moved[:, :, np.isin(BAND, EXCITED)] = multisine(level * 2 * np.pi * EXCITED / PERIOD_S, phases)
    others = generator.standard_normal((2, *moved.shape))
    moved[:, :, ~np.isin(BAND, EXCITED)] = (5 * (others[0] + 1j * others[1]))[:, :, ~np.isin(BAND, EXCITED)]
    omega = 2 * np.pi * BAND / PERIOD_S
    position = time_signal(-moved / omega[:, None] ** 2, BAND, N_SAMPLE)
    shape = (1, REALIZATIONS, MOTORS, 2, N_SAMPLE, MOTORS)
    record = Record(
        sampling_period_s=SAMPLING_S,
        configurations=np.zeros((1, MOTORS)),
        inputs=np.zeros(shape),
        outputs=np.broadcast_to(position[None, :, :, None], shape).copy(),
        reference=None,
        excited_lines=EXCITED,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(NAMES, "torque"),
        output_channels=motor_channels(NAMES, "angle"),
        output_offset=np.array([[0.3, -0.2]]),
    )
    law_torque = whole_torque(record, BAND, (laws, *further))
    linear = np.einsum("kij,rekj->reki", inverse_response(BAND), moved)
    command = linear + 2 * np.moveaxis(law_torque, -1, 1)
    stray = generator.standard_normal((2, *command.shape))
    command += unexplained * (stray[0] + 1j * stray[1])
    torque = np.broadcast_to(time_signal(command, BAND, N_SAMPLE)[None, :, :, None], shape)
    return replace(record, inputs=torque + noise * generator.standard_normal(shape))


def identify(record, stated):
    start = start_laws(record, stated, DELAY_S)
    return combine_laws([identify_laws(record, start, DELAY_S)], start, stated, NAMES)


def test_blind_identification_returns_law_and_response():
    record = make_record((BRISTLE, CURVE))
    laws, notes = identify(record, UNKNOWN)
    assert notes == ()
    assert [law.law.name for law in laws] == ["lugre", "stribeck"]
    for found, true in zip(laws, (BRISTLE, CURVE), strict=True):
        np.testing.assert_allclose(found.values[:4], true.values[:4], rtol=0.03)
        np.testing.assert_allclose(found.values[4:], true.values[4:], atol=0.03)
    plain = estimate_frf(record, EstimateOptions(compensation="none")).response[0]
    found = estimate_frf(record, EstimateOptions(compensation="silent_lines"), laws, DELAY_S)
    exact = np.linalg.inv(inverse_response(EXCITED))
    diagonal = np.diagonal(found.response[0] / exact - 1, axis1=1, axis2=2)
    assert np.median(np.abs(diagonal)) < 1e-3
    assert np.median(np.abs(np.diagonal(plain / exact - 1, axis1=1, axis2=2))) > 5e-3
    np.testing.assert_allclose(found.uncompensated_response[0], plain)
    assert found.law_names[:2] == ("first.coulomb_nm", "first.static_nm")
    np.testing.assert_allclose(found.law_values[:2], laws[0].values[:2])
    assert found.compensation == "silent_lines"


def test_file_is_the_start_and_its_distance_is_told():
    stated = tuple(
        replace(law, coulomb_nm=0.8 * law.coulomb_nm, static_nm=0.8 * law.static_nm) for law in (BRISTLE, CURVE)
    )
    laws, _ = identify(make_record((BRISTLE, CURVE)), stated)
    np.testing.assert_allclose([law.offset[0] for law in laws], 0.25, atol=0.02)
    np.testing.assert_allclose([law.offset[1] for law in laws], 0.0, atol=0.02)
    known = replace(BRISTLE, relative_std=0.1).coefficient_std
    assert all(0 < new < old for new, old in zip(laws[0].coefficient_std, known, strict=True))


def test_intervals_hold_the_truth():
    errors = []
    for seed in range(12):
        laws, _ = identify(make_record((BRISTLE, CURVE), noise=0.1, seed=seed), (BRISTLE, CURVE))
        for law, true, used in zip(laws, (BRISTLE, CURVE), (slice(7), slice(5)), strict=True):
            errors.extend((np.array(law.values) - true.values)[used] / np.array(law.values_std)[used])
    inside = np.mean(np.abs(errors) < 1.96)
    # 144 correlated draws: four binomial standard deviations below 0.95, and no interval so wide that none misses.
    assert 0.85 < inside < 1.0, inside


def test_configurations_join_by_their_information():
    start = (BRISTLE, CURVE)
    estimates = [identify_laws(make_record(start, noise=0.1, seed=seed), start, DELAY_S) for seed in range(4)]
    one = combine_laws(estimates[:1], start, start, NAMES)[0][0]
    four = combine_laws(estimates, start, start, NAMES)[0][0]
    ratio = np.array(four.values_std) / one.values_std
    assert 0.3 < np.median(ratio) < 0.8, ratio


def test_an_error_of_form_does_not_average_over_configurations():
    start = (BRISTLE, CURVE)
    estimates = [identify_laws(make_record(start, noise=0.1, seed=seed), start, DELAY_S) for seed in range(4)]
    assert np.mean([each.form_share for each in estimates]) < 0.2
    wrong = [replace(each, form_share=np.ones(MOTORS)) for each in estimates]
    alike = [replace(wrong[0], values=wrong[0].values.copy()) for _ in range(4)]
    one = combine_laws(alike[:1], start, start, NAMES)[0][1]
    four = combine_laws(alike, start, start, NAMES)[0][1]
    np.testing.assert_allclose(four.values_std[:5], one.values_std[:5])


def bristles(width):
    """A third of each motor's level in bristles of one width."""
    return tuple(
        TorqueLaw(law.coulomb_nm / 3, law.coulomb_nm / 3, law.stribeck_rad_s, width, 0.1, 0.0, 4, LUGRE)
        for law in (BRISTLE, CURVE)
    )


def level_errors(seed):
    """How far the best level at the excited lines is from the identified one, in its deviations (motor,)."""
    true = tuple(bristles(width) for width in (0.01, 0.05, 0.25))
    record = make_record(*true, noise=0.02, seed=seed)
    laws, _ = identify(record, UNKNOWN)
    moved = disturbance(record_motion(record, EXCITED, DELAY_S), laws)
    error = whole_torque(record, EXCITED, true) - moved.torque
    acceleration = record_blocks(record, EXCITED).outputs
    rate = 2j * np.pi * EXCITED[:, None] / PERIOD_S
    found = []
    for motor, law in enumerate(laws):
        # A fit also moves width and lag; spring, damper and inertia are the linear model's.
        linear = [acceleration[:, :, motor] / rate**power for power in range(3)]
        columns = np.array([each.ravel() for each in (*moved.derivative[:3, :, :, motor], *linear)]).T
        wanted = error[:, :, motor].ravel()
        stacked = np.vstack([columns.real, columns.imag]), np.concatenate([wanted.real, wanted.imag])
        found.append(np.linalg.lstsq(*stacked, rcond=None)[0][0] / law.coefficient_std[0])
    return found


def test_deviations_of_the_level_hold_an_error_of_form():
    # An RMS of six draws; where the pulls of the lines add with their powers it is 8.
    errors = [level_errors(seed) for seed in range(3)]
    assert np.sqrt(np.mean(np.square(errors))) < 2.5, errors


def test_motor_without_friction_is_left_alone():
    free = tuple(replace(law, coulomb_nm=0.0, static_nm=0.0, ripple_nm=0.0) for law in (BRISTLE, CURVE))
    record = make_record(
        tuple(replace(law, coulomb_nm=1e-9, static_nm=1e-9, ripple_nm=0.0) for law in (BRISTLE, CURVE)), noise=0.3
    )
    laws, notes = identify(record, free)
    assert all(law.is_zero for law in laws)
    assert len(notes) == MOTORS
    assert "noise only" in notes[0]


def test_what_no_law_explains_is_refused():
    with pytest.raises(DataError, match=r"explain too little .* first .*second"):
        identify(make_record((BRISTLE, CURVE), unexplained=2.0), UNKNOWN)


def test_a_level_that_no_motor_could_overcome_is_refused():
    record = make_record((BRISTLE, CURVE))
    start = start_laws(record, UNKNOWN, DELAY_S)
    found = identify_laws(record, start, DELAY_S)
    torque = record.inputs[0]
    highest = np.abs(torque - torque.mean(axis=(2, 3), keepdims=True)).max(axis=(0, 1, 2, 3))
    np.testing.assert_allclose(found.torque_peak, highest)
    combine_laws([found], start, UNKNOWN, NAMES)
    weak = replace(found, torque_peak=np.array([highest[0], 0.3]))
    with pytest.raises(DataError, match=r"whole torque: second \(0\.4") as caught:
        combine_laws([weak], start, UNKNOWN, NAMES)
    assert caught.value.exit_code == 4
    assert "`compensation: nominal`" in caught.value.remedy


def test_experiments_that_determine_no_response_are_refused():
    record = make_record((BRISTLE, CURVE))
    still = replace(record, outputs=record.outputs * np.array([1.0, 0.0]))
    single = replace(record, inputs=record.inputs[:, :, :1], outputs=record.outputs[:, :, :1])
    for poor in (still, single):
        with pytest.raises(DataError, match="D025"):
            start_laws(poor, UNKNOWN, DELAY_S)


def test_too_few_silent_lines_are_refused():
    record = replace(make_record((BRISTLE, CURVE)), excited_lines=BAND)
    with pytest.raises(DataError, match="only 0 lines of the excited band are silent and can show friction"):
        start_laws(record, UNKNOWN, DELAY_S)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_disturbance(kind):
    record = make_record((BRISTLE, CURVE))
    motion = record_motion(record, EXCITED, DELAY_S)

    def torque(change):
        level, shape, lag, sine, cosine = (change * (name == kind) for name in KINDS)
        laws = [
            replace(
                law,
                coulomb_nm=law.coulomb_nm * (1 + level),
                static_nm=law.static_nm * (1 + level),
                stribeck_rad_s=law.stribeck_rad_s * (1 + shape),
                width=law.width * (1 + shape),
                lag_samples=law.lag_samples + lag,
                ripple_sin=law.ripple_sin + sine,
                ripple_cos=law.ripple_cos + cosine,
            )
            for law in (BRISTLE, CURVE)
        ]
        return disturbance(motion, laws).torque

    step = 1e-2
    slope = (torque(step) - torque(-step)) / (2 * step)
    found = disturbance(motion, (BRISTLE, CURVE)).derivative[KINDS.index(kind)]
    # The derivative by shape is a secant over 5 %; friction has single precision.
    tolerance = 0.06 if kind == "shape" else 3e-5
    assert np.abs(found - slope).max() < tolerance * np.abs(slope).max()


def test_torque_is_what_the_hold_makes_of_the_command():
    record = make_record((BRISTLE, CURVE))
    motion = record_motion(record, EXCITED, DELAY_S)
    law = replace(CURVE, coulomb_nm=1.0, static_nm=1.0)
    found = disturbance(motion, (law, law)).torque
    speed = np.moveaxis(motion.speed, 0, -2)
    continuous = line_amplitudes(np.tanh(speed / law.width), EXCITED)
    omega = 2 * np.pi * EXCITED / PERIOD_S
    held = (1 - np.exp(-1j * omega * SAMPLING_S)) / (1j * omega * SAMPLING_S) * np.exp(-1j * omega * DELAY_S)
    np.testing.assert_allclose(np.moveaxis(found, -1, 1), continuous / held[:, None], rtol=1e-9)

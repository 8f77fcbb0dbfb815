"""A measured overhead crane: its log, its pendulum, and its cart as an integrator of the reference velocity."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.local_model import line_scatter, rational_mode
from robid.frf.options import EstimateOptions
from robid.logs.importing import import_log
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel
from robid.signals.quantities import describe

N_SAMPLE, STEP_S, LINES = 8192, 0.02, np.arange(1, 820)  # 163.84 s; all lines to 5 Hz are excited
CABLE_M = 0.4557
PENDULUM_HZ = np.sqrt(9.81 / CABLE_M) / (2 * np.pi)


def mapping_of(file, name):
    return LogMapping(
        file=file,
        sampling_period_s=STEP_S,
        drop_periods=0,
        take="last",
        time=TimeChannel(f"{name}.X.Data"),
        inputs=(InputChannel("cart", f"{name}.Y(4).Data", "m/s", sign=-1),),
        outputs=(
            OutputChannel("cart", f"{name}.Y(2).Data", "m", scale=0.035 * np.pi / 9000),
            OutputChannel("cable", f"{name}.Y(1).Data", "rad", scale=2 * np.pi / 10000),
        ),
    )


def bring(mapping, samples_per_period=N_SAMPLE, periods=10):
    return import_log(
        mapping,
        samples_per_period=samples_per_period,
        periods=periods,
        excited_lines=LINES,
        configurations=np.zeros((1, 1)),
    )


@pytest.fixture(params=["meas1", "meas2"])
def crane(request, data_folder):
    return mapping_of(data_folder("crane") / f"{request.param}.mat", request.param)


def test_the_crane_is_a_pendulum_below_an_integrator(crane):
    record = bring(crane)
    assert record.inputs.shape == (1, 1, 1, 10, N_SAMPLE, 1)
    assert record.input_channels[0].unit == "m/s"
    frf = estimate_frf(record, EstimateOptions(compensation="none", pooled_lines=1))
    assert describe(frf.input_channels) == "motor speed reference (cart)"
    assert [(channel.quantity, channel.unit) for channel in frf.output_channels] == [
        ("position", "m"),
        ("angle", "rad"),
    ]
    omega = 2 * np.pi * frf.frequency_hz
    cart, cable = frf.response[0, :, :, 0].T
    band = (frf.frequency_hz > 0.1) & (frf.frequency_hz < 2)
    peak = frf.lines[band][np.argmax(np.abs(cable[band]))]
    assert abs(peak - PENDULUM_HZ * N_SAMPLE * STEP_S) < 2
    slow = (frf.frequency_hz > 0.02) & (frf.frequency_hz < 1)
    slope, _ = np.polyfit(np.log10(omega[slow]), 20 * np.log10(np.abs(cart[slow])), 1)
    assert slope == pytest.approx(-20, abs=0.1)
    gain = np.abs(cart * omega)[slow]
    assert np.median(gain) == pytest.approx(0.59, abs=0.01)
    assert gain.std() / gain.mean() < 0.02
    assert np.degrees(np.angle(cart[slow])).mean() == pytest.approx(-90, abs=3)


def test_the_pendulum_hangs_from_the_cart(crane):
    """Cable angle over cart position is w^2 / (g - L w^2), away from the damped resonance."""
    frf = estimate_frf(bring(crane), EstimateOptions(compensation="none", pooled_lines=1))
    omega = 2 * np.pi * frf.frequency_hz
    ratio = frf.response[0, :, 1, 0] / frf.response[0, :, 0, 0]
    exact = omega**2 / (9.81 - CABLE_M * omega**2)
    for low_hz, high_hz in ((0.3, 0.65), (0.85, 2.0)):
        band = (frf.frequency_hz > low_hz) & (frf.frequency_hz < high_hz)
        assert np.median(np.abs(np.abs(ratio[band] / exact[band]) - 1)) < 0.05


def test_the_noise_is_that_of_the_encoders(crane):
    """The covariance of the responses against the scatter of the periods, computed apart; levels as measured."""
    record = bring(crane)
    frf = estimate_frf(record, EstimateOptions(compensation="none", pooled_lines=1))
    assert frf.total_covariance is None
    # All lines are excited: no window, which would mix neighbours that vary with the response.
    spectrum = np.fft.rfft(record.outputs[0, 0, 0], axis=1)[:, LINES]
    velocity = np.abs(np.fft.rfft(record.inputs[0, 0, 0].mean(axis=0), axis=0)[LINES])
    scatter = spectrum.std(axis=0, ddof=1) / np.sqrt(10) / velocity
    ratio = np.sqrt(frf.element_variance())[0, 50:, :, 0] / scatter[50:]
    cart, cable = np.median(ratio, axis=0)
    assert cable == pytest.approx(1.0, abs=0.02)
    # The cart's drift is removed from ours.
    assert 0.5 < cart < 1.0
    relative = np.median(np.sqrt(frf.element_variance())[0, :, :, 0] / np.abs(frf.response[0, :, :, 0]), axis=0)
    assert np.all(20 * np.log10(relative) < [-60, -40])


@pytest.mark.parametrize("stated", [8191, 8193])
def test_a_period_off_by_one_is_refused(crane, stated):
    with pytest.raises(DataError, match=f"repeats every {N_SAMPLE} samples"):
        bring(crane, stated, periods=8)


def test_an_eleventh_period_and_a_wrong_field_are_told(crane):
    with pytest.raises(DataError, match="Set periods to 10 at most"):
        bring(crane, periods=11)
    name = crane.file.stem
    wrong = replace(crane, outputs=(OutputChannel("cable", f"{name}.Y(6).Data"),))
    with pytest.raises(DataError, match=f"`{name}.Y\\([1-5]\\).Data`"):
        bring(wrong)


@pytest.mark.parametrize("name", ["meas1", "meas2"])
def test_halves_of_a_crane_recording_agree_within_what_its_lines_scatter(data_folder, name):
    """They do not within the noise of their periods, which is ten times less than a half differs from the other."""
    record = bring(mapping_of(data_folder("crane") / f"{name}.mat", name))
    peaks, noise, scatter = zip(*(_pendulum(_periods(record, slice(a, a + 5))) for a in (0, 5)), strict=True)
    assert abs(peaks[1] - peaks[0]) < 1.96 * np.hypot(*scatter)
    assert np.hypot(*scatter) > 5 * np.hypot(*noise)


def test_recordings_of_a_crane_agree_where_their_largest_lines_are_neighbours(data_folder):
    records = [bring(mapping_of(data_folder("crane") / f"{name}.mat", name)) for name in ("meas1", "meas2")]
    peaks, _, scatter = zip(*(_pendulum(record) for record in records), strict=True)
    assert abs(peaks[1] - peaks[0]) < 1.96 * np.hypot(*scatter)
    np.testing.assert_allclose(peaks, PENDULUM_HZ, rtol=0.005)


def _periods(record, chosen):
    return replace(record, inputs=record.inputs[:, :, :, chosen], outputs=record.outputs[:, :, :, chosen])


def _pendulum(record):
    """Peak of the cable's angle, and its deviation by noise alone and by what the lines scatter [Hz]."""
    frf = estimate_frf(record, EstimateOptions(compensation="none", pooled_lines=1))
    hz, angle = frf.frequency_hz, frf.response[:, :, 1:, :]
    omega, natural = 2 * np.pi * hz, 2 * np.pi * PENDULUM_HZ
    pendulum = 1j * omega / (natural**2 - omega**2 + 0.04j * omega * natural)
    noise = frf.element_variance()[:, :, 1:, :]
    seen = np.maximum(noise, line_scatter(angle, pendulum[None, :, None, None]) * np.abs(angle) ** 2)
    swings = np.flatnonzero((hz > 0.6) & (hz < 0.9))
    line = int(swings[np.abs(angle[0, swings, 0, 0]).argmax()])
    by_noise, by_lines = (
        rational_mode(hz, angle[0, :, 0, 0], each[0, :, 0, 0], line, "resonance") for each in (noise, seen)
    )
    return by_lines.peak_hz, by_noise.peak_std_hz, by_lines.peak_std_hz

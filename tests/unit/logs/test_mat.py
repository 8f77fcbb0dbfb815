"""Import of MAT logs: what a good log becomes, and every way a log can be other than was said."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError, SettingsError
from robid.logs.importing import import_log, import_shot, join_shots
from robid.logs.mapping import LogMapping
from robid.logs.period import format_lines
from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel
from robid.signals.log_options import TimeChannel

STEP = 1e-3
PERIOD = 1000
PERIODS = 5
LINES = np.arange(5, 80, 2)


def make_signals(period=PERIOD, periods=PERIODS, lines=LINES, noise=0.02, seed=1):
    """Current and two drifting angles of a multisine, with noise."""
    generator = np.random.default_rng(seed)
    sample = np.arange(period * periods)
    phases = generator.uniform(0, 2 * np.pi, (3, len(lines)))
    waves = [np.cos(2 * np.pi * np.outer(sample, lines) / period + phase).sum(axis=1) for phase in phases]
    current, motor, load = (wave + noise * wave.std() * generator.normal(size=len(wave)) for wave in waves)
    drift = 1e-4 * sample
    time = np.round(sample * STEP * 1e6).astype(np.int32)
    return {"iq": current, "q_motor": 3.0 + motor + drift, "q_load": -1.0 + load + drift, "time": time}


def make_mapping(file):
    return LogMapping(
        file=file,
        sampling_period_s=STEP,
        drop_periods=1,
        time=TimeChannel("time", "us"),
        inputs=(InputChannel("motor", "iq", "A", torque_constant_nm_a=0.5, torque_constant_relative_std=0.02),),
        outputs=(OutputChannel("motor", "q_motor"), OutputChannel("load", "q_load", "deg", sign=-1)),
    )


def run(folder, signals, *, mapping=None, period=PERIOD, periods=PERIODS - 1, lines=LINES):
    file = folder / "log.mat"
    savemat(file, {name: np.reshape(values, (-1, 1)) for name, values in signals.items()})
    return import_log(
        replace(mapping, file=file) if mapping else make_mapping(file),
        samples_per_period=period,
        periods=periods,
        excited_lines=lines,
        configurations=np.zeros((1, 1)),
    )


def import_file(file):
    return import_log(
        make_mapping(file),
        samples_per_period=PERIOD,
        periods=4,
        excited_lines=LINES,
        configurations=np.zeros((1, 1)),
    )


def refused(folder, signals, **arguments):
    with pytest.raises(DataError) as caught:
        run(folder, signals, **arguments)
    assert "log.mat" in str(caught.value)
    return str(caught.value)


def test_a_good_log_becomes_a_record(tmp_path):
    signals = make_signals()
    record = run(tmp_path, signals)
    assert record.inputs.shape == (1, 1, 1, 4, PERIOD, 1)
    assert record.outputs.shape == (1, 1, 1, 4, PERIOD, 2)
    np.testing.assert_allclose(record.inputs.ravel(), 0.5 * signals["iq"][PERIOD:], rtol=1e-12)
    measured = np.stack([signals["q_motor"], -np.radians(signals["q_load"])], axis=1)[PERIOD:]
    np.testing.assert_allclose(record.output_offset[0], measured[0], rtol=1e-12)
    absolute = record.outputs + record.output_offset[:, None, None, None, None]
    np.testing.assert_allclose(absolute.reshape(-1, 2), measured, rtol=1e-12)
    assert (record.input_names, record.output_names) == (("motor",), ("motor", "load"))
    assert record.reference is None
    assert record.input_channels[0].unit == "N m"
    notes = " ".join(record.notes)
    assert "2 % (1 sigma)" in notes


def test_an_unknown_torque_constant_leaves_a_current(tmp_path):
    signals = make_signals()
    mapping = replace(make_mapping(Path()), inputs=(InputChannel("motor", "iq", "A", normalised=True, sign=-1),))
    record = run(tmp_path, signals, mapping=mapping)
    assert record.input_channels[0].unit == "A"
    np.testing.assert_allclose(record.inputs.ravel(), -signals["iq"][PERIOD:], rtol=1e-12)
    assert any("only ratios to K_t" in note for note in record.notes)


@pytest.mark.parametrize("stated", [999, 1001, 1003, 1010, 500, 1500, 700])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.3])
def test_a_wrong_period_is_refused_and_the_real_one_proposed(tmp_path, stated, noise):
    message = refused(tmp_path, make_signals(periods=8, noise=noise), period=stated, periods=3)
    assert f"repeats every {PERIOD} samples (1 s), not every {stated}" in message
    assert "Set excitation.period_s to 1," in message


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_the_right_period_is_never_refused(tmp_path, noise, seed):
    assert run(tmp_path, make_signals(noise=noise, seed=seed)).inputs.shape[3] == 4


def test_a_slow_excitation_off_by_one_sample_is_caught(tmp_path):
    lines = np.arange(3, 20, 2)
    signals = make_signals(lines=lines, noise=0.01)
    message = refused(tmp_path, signals, period=PERIOD + 1, periods=3, lines=lines)
    assert f"repeats every {PERIOD} samples" in message
    assert run(tmp_path, signals, lines=lines).inputs.shape[4] == PERIOD


def test_a_double_period_holds_twice_the_lines(tmp_path):
    signals = make_signals(periods=8)
    message = refused(tmp_path, signals, period=2 * PERIOD, periods=3)
    assert f"repeats every {PERIOD} samples" in message
    assert run(tmp_path, signals, period=2 * PERIOD, periods=3, lines=2 * LINES).inputs.shape[3:5] == (3, 2 * PERIOD)


def test_a_period_with_a_fraction_of_a_sample_is_refused(tmp_path):
    signals = make_signals(period=1000.4, periods=10)
    message = refused(tmp_path, {name: values[:9000] for name, values in signals.items()}, periods=8)
    assert float(re.search(r"Its period is ([\d.]+) samples", message)[1]) == pytest.approx(1000.4, abs=0.01)
    assert "Set resample to period" in message


def test_a_signal_that_never_repeats_is_refused(tmp_path):
    signals = make_signals()
    signals["iq"] = np.random.default_rng(2).normal(size=len(signals["iq"]))
    assert "does not repeat with a period of 1000 samples" in refused(tmp_path, signals)


def test_one_period_cannot_be_checked_and_says_so(tmp_path):
    record = run(tmp_path, make_signals(periods=1), mapping=replace(make_mapping(Path()), drop_periods=0), periods=1)
    assert any("could not be checked" in note for note in record.notes)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (np.arange(77, 200, 2), "1 of 62 carry some"),
        (np.arange(6, 80, 2), "0 of 37 carry some"),
        (np.arange(101, 200, 2), "0 of 50 carry some"),
    ],
)
def test_lines_that_are_not_excited_are_named(tmp_path, lines, words):
    signals = make_signals(lines=np.arange(5, 78, 2))
    message = refused(tmp_path, signals, lines=lines)
    assert words in message
    assert "The energy is at lines 5-77 by 2" in message


def test_a_wrong_name_gets_a_suggestion(tmp_path):
    mapping = replace(make_mapping(Path()), outputs=(OutputChannel("motor", "q_moter"),))
    message = refused(tmp_path, make_signals(), mapping=mapping)
    assert "variable `q_moter`: D040" in message
    assert "Did you mean `q_motor`" in message


def test_a_wrong_name_of_a_structure_gets_a_suggestion(tmp_path):
    signals = make_signals()
    savemat(tmp_path / "log.mat", {**signals, "exp1": {"angle": signals["q_motor"]}})
    mapping = replace(make_mapping(tmp_path / "log.mat"), outputs=(OutputChannel("motor", "exp.angle"),), one_shot=True)
    with pytest.raises(DataError, match=r"Did you mean `exp1\.angle`"):
        import_shot(mapping)


def test_a_wrong_length_is_named(tmp_path):
    signals = make_signals()
    signals["q_load"] = signals["q_load"][:-3]
    message = refused(tmp_path, signals)
    assert "variable `q_load`: D048 It has 4997 samples, the other channels have 5000" in message


@pytest.mark.parametrize(
    ("value", "told"), [(np.nan, "NaN or infinite"), (np.inf, "NaN or infinite"), (-3e202, "beyond 1e+100")]
)
def test_values_that_are_none_are_located(tmp_path, value, told):
    signals = make_signals()
    signals["q_motor"][[1234, 2000]] = value
    signals["iq"] = signals["iq"].astype(np.float32)  # which may lie beside doubles
    message = refused(tmp_path, signals)
    assert f"variable `q_motor`, sample 1234: D043 2 of 5000 values are {told}" in message
    assert "Set resample to time" in message
    signals["q_motor"][1234:1260] = value
    message = refused(tmp_path, signals)
    assert f"variable `q_motor`, sample 1234: D043 27 of 5000 values are {told}" in message
    assert "from_s to 1.26" in message


@pytest.mark.parametrize("name", ["iq", "q_motor"])
def test_a_sample_that_a_flipped_bit_made_absurd_is_located(tmp_path, name):
    signals = make_signals()
    signals[name][1234] = 0.3
    signals[name][1234:1235].view(np.uint64)[0] ^= np.uint64(1 << 62)
    with pytest.raises(DataError, match="for one sample, more than 1e") as caught:
        run(tmp_path, signals)
    assert f"`{name}`, sample 1234" in caught.value.where
    assert "copy the log again" in caught.value.remedy


def test_a_flipped_bit_that_makes_a_signalling_nan_is_located(tmp_path):
    signals = make_signals()
    signals["iq"][1234] = 1.3
    signals["iq"][1234:1235].view(np.uint64)[0] ^= np.uint64(1 << 62)
    assert "`iq`, sample 1234: D043 1 of 5000 values are NaN" in refused(tmp_path, signals)


@pytest.mark.parametrize("resolution", [0.0, 0.5])
def test_an_impact_and_a_start_from_elsewhere_are_no_damage(tmp_path, resolution):
    signals = make_signals()
    signals["iq"][700] = 1e4 * np.ptp(signals["iq"])
    signals["q_motor"][0] = 1e9
    if resolution:
        signals["q_load"] = resolution * np.round(signals["q_load"] / resolution)
    run(tmp_path, signals)


def test_a_constant_channel_is_refused(tmp_path):
    signals = make_signals()
    signals["q_load"][:] = 0.25
    assert "variable `q_load`: D044 It is constant (0.25)" in refused(tmp_path, signals)


def test_too_few_periods_are_counted(tmp_path):
    message = refused(tmp_path, make_signals(), periods=7)
    assert "contains 5 periods of 1000 samples, fewer than the 8" in message
    assert "Set periods to 4 at most" in message
    none_left = refused(tmp_path, make_signals(), mapping=replace(make_mapping(Path()), drop_periods=5))
    assert "Record longer" in none_left
    assert "Set periods" not in none_left


def test_a_time_unit_off_by_a_thousand_is_named(tmp_path):
    mapping = replace(make_mapping(Path()), time=TimeChannel("time", "ms"))
    assert "time unit is off by a factor of 1000" in refused(tmp_path, make_signals(), mapping=mapping)


def test_another_sampling_period_is_proposed(tmp_path):
    mapping = replace(make_mapping(Path()), sampling_period_s=1.25e-3)
    message = refused(tmp_path, make_signals(), mapping=mapping)
    assert "Set sampling_period_s to 0.001" in message


def test_a_slightly_wrong_clock_is_named(tmp_path):
    signals = make_signals()
    signals["time"] = signals["time"] * 1.0005
    assert "mean time step is 0.0010005 s" in refused(tmp_path, signals)


def test_a_gap_is_located_and_counted(tmp_path):
    signals = make_signals()
    kept = np.delete(np.arange(5000), np.arange(2101, 2104))
    message = refused(tmp_path, {name: values[kept] for name, values in signals.items()}, periods=3)
    assert "variable `time`, sample 2100: D126 1 gap, about 3 missing samples" in message
    assert "0.004 s instead of 0.001 s" in message


def test_jitter_is_measured(tmp_path):
    signals = make_signals()
    signals["time"] = signals["time"] + np.random.default_rng(3).uniform(-100, 100, 5000)
    message = refused(tmp_path, signals)
    assert "deviate from 0.001 s by up to" in message
    assert "Set resample to time" in message


def test_time_that_runs_backward_is_located(tmp_path):
    signals = make_signals()
    signals["time"][3000:] -= 2000
    assert "sample 2999: D122" in refused(tmp_path, signals)


def test_a_constant_time_is_one_problem(tmp_path):
    signals = make_signals()
    signals["time"][:] = 3.0
    message = refused(tmp_path, signals)
    assert "D121 Time does not advance: it is constant (3)" in message

    assert message.count("remedy") == 1


def test_all_problems_come_at_once(tmp_path):
    signals = make_signals()
    signals["q_motor"][10] = np.nan
    signals["q_load"][:] = 1.0
    mapping = replace(make_mapping(Path()), time=TimeChannel("tmie", "us"))
    message = refused(tmp_path, signals, mapping=mapping, period=1001, periods=3)
    assert "4 problems" in message
    for words in ("`q_motor`, sample 10", "`q_load`: D044", "`tmie`", "repeats every 1000 samples"):
        assert words in message


def test_the_mapping_is_checked_before_the_file(tmp_path):
    mapping = LogMapping(
        file=tmp_path / "absent.mat",
        sampling_period_s=STEP,
        inputs=(
            InputChannel("motor", "iq", "kA"),
            InputChannel("motor", "iq", "N m", sign=2),
            InputChannel("motor", "iq", "N m", torque_constant_nm_a=2),
        ),
        outputs=(),
    )
    with pytest.raises(SettingsError) as caught:
        import_log(
            mapping,
            samples_per_period=100,
            periods=1,
            excited_lines=np.array([1, 50]),
            configurations=np.zeros((1, 1)),
        )
    for words in ("no output", "`kA`", "sign 2", "S368", "twice", "1 to 49, below Nyquist"):
        assert words in str(caught.value)


def test_a_normalised_current_has_no_torque_constant(tmp_path):
    channel = InputChannel("motor", "iq", "A", torque_constant_nm_a=0.5, normalised=True)
    with pytest.raises(SettingsError, match="S369"):
        run(tmp_path, make_signals(), mapping=replace(make_mapping(Path()), inputs=(channel,)))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "does not exist"),
        (b"time,iq\n0,1\n" * 50, "cannot be read as a MAT file"),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(400), "cannot be read as a MAT file"),
    ],
)
def test_unreadable_files_are_refused(tmp_path, content, words):
    file = tmp_path / "log.mat"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(DataError, match=words) as caught:
        import_log(
            make_mapping(file),
            samples_per_period=PERIOD,
            periods=4,
            excited_lines=LINES,
            configurations=np.zeros((1, 1)),
        )
    assert str(file) in str(caught.value)
    assert caught.value.remedy


def test_a_truncated_file_is_refused(tmp_path):
    file = tmp_path / "whole.mat"
    savemat(file, make_signals(), do_compression=True)
    cut = tmp_path / "log.mat"
    cut.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(DataError):
        import_log(
            make_mapping(cut),
            samples_per_period=PERIOD,
            periods=4,
            excited_lines=LINES,
            configurations=np.zeros((1, 1)),
        )


def shot_of(file, **changes):
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel("time", "us"),
        inputs=(InputChannel("motor", "iq", "mA", torque_constant_nm_a=0.5),),
        outputs=(
            OutputChannel("motor", "count", "counts", counts_per_turn=8192),
            OutputChannel("motor.tacho", "speed", "rpm"),
            OutputChannel("slide", "stage", "mm", side="tool"),
        ),
        references=(ReferenceChannel("motor", "told", "deg"),),
        one_shot=True,
    )
    return import_shot(replace(mapping, **changes))


def write_shot(file, n_sample=700, **changes):
    time = np.arange(n_sample) * STEP
    angle = 2.0 + time**2
    columns = {
        "time": np.round(1e6 * time),
        "iq": 1e3 * np.cos(time),
        "count": 8192 * angle / (2 * np.pi),
        "speed": 2 * time * 30 / np.pi,
        "stage": 1e3 * 0.3 * angle,
        "told": np.degrees(angle + 0.1),
    }
    columns |= {name: np.full(n_sample, value) for name, value in changes.items()}
    savemat(file, {name: values[:, None] for name, values in columns.items()})
    return time, angle


def test_one_shot_is_read_whole_in_si_units(tmp_path):
    time, angle = write_shot(tmp_path / "log.mat")
    record = shot_of(tmp_path / "log.mat")
    assert record.is_one_shot
    assert record.configurations is None
    assert record.inputs.shape == (1, 1, 1, 1, 700, 1)
    np.testing.assert_allclose(record.inputs[0, 0, 0, 0, :, 0], 0.5 * np.cos(time), rtol=1e-12)
    absolute = (record.outputs + record.output_offset)[0, 0, 0, 0]
    np.testing.assert_allclose(absolute, np.stack([angle, 2 * time, 0.3 * angle], axis=1), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(record.reference[0, 0, 0, :, 0], angle + 0.1, rtol=1e-12)
    assert [str(one.quantity) for one in record.output_channels] == ["angle", "speed", "position"]
    assert [(one.quantity, one.unit) for one in record.reference_channels] == [("position_command", "rad")]
    assert record.output_channels[2].side == "tool"


def test_a_recording_in_two_logs_whose_columns_share_their_names(tmp_path):
    time, angle = write_shot(tmp_path / "log.mat")
    savemat(tmp_path / "torques.mat", {"count": np.cos(time)[:, None], "short": time[:9, None]})
    inputs = (InputChannel("motor", "count", "N m", file="torques"),)
    record = shot_of(tmp_path / "log.mat", inputs=inputs, files={"torques": tmp_path / "torques.mat"})
    np.testing.assert_allclose(record.inputs[0, 0, 0, 0, :, 0], np.cos(time), rtol=1e-12)
    np.testing.assert_allclose((record.outputs + record.output_offset)[0, 0, 0, 0, :, 0], angle, rtol=1e-12)
    for variable, told in (("short", "9 samples, the other channels have 700"), ("none", "D040")):
        inputs = (InputChannel("motor", variable, "N m", file="torques"),)
        with pytest.raises(DataError, match=told) as caught:
            shot_of(tmp_path / "log.mat", inputs=inputs, files={"torques": tmp_path / "torques.mat"})
        assert caught.value.where == f"{tmp_path / 'torques.mat'}: variable `{variable}`"


def test_angles_count_from_their_zero(tmp_path):
    _, angle = write_shot(tmp_path / "log.mat")
    outputs = (OutputChannel("motor", "count", "counts", counts_per_turn=8192, sign=-1, zero=2048),)
    record = shot_of(tmp_path / "log.mat", outputs=outputs)
    absolute = (record.outputs + record.output_offset)[0, 0, 0, 0, :, 0]
    np.testing.assert_allclose(absolute, -(angle - np.pi / 2), rtol=1e-12)
    assert record.outputs[0, 0, 0, 0, 0, 0] == 0


def test_repeated_shots_are_realizations_cut_to_the_shortest(tmp_path):
    records = []
    for index, length in enumerate((700, 640)):
        write_shot(tmp_path / f"{index}.mat", length)
        records.append(shot_of(tmp_path / f"{index}.mat"))
    joined = join_shots(records)
    assert joined.inputs.shape == (1, 2, 1, 1, 640, 1)
    assert joined.reference.shape == (1, 2, 1, 640, 1)
    assert joined.notes[-1] == "The shots have 640 to 700 samples; all were cut to the shortest."
    np.testing.assert_allclose(joined.outputs[0, 0], joined.outputs[0, 1], atol=1e-12)
    assert join_shots(records[:1] * 2).notes == records[0].notes


def test_a_joint_that_stands_still_in_a_shot_is_noted(tmp_path):
    write_shot(tmp_path / "log.mat")
    assert not any("Constant" in note for note in shot_of(tmp_path / "log.mat").notes)
    _, angle = write_shot(tmp_path / "log.mat", speed=0.0, iq=25.0)
    record = shot_of(tmp_path / "log.mat")
    assert record.notes[-1] == "Constant in log.mat: `iq` (25), `speed` (0); right only where these joints stood still."
    np.testing.assert_allclose((record.outputs + record.output_offset)[0, 0, 0, 0, :, 0], angle, rtol=1e-12)
    write_shot(tmp_path / "log.mat", count=8192.0, speed=0.0, stage=1.0)
    with pytest.raises(DataError, match="D095"):
        shot_of(tmp_path / "log.mat")


def test_a_shot_is_checked_as_other_logs_are(tmp_path):
    write_shot(tmp_path / "log.mat")
    with pytest.raises(DataError, match=r"a sampling period of 0\.002 s was stated"):
        shot_of(tmp_path / "log.mat", sampling_period_s=2e-3)
    with pytest.raises(SettingsError, match="S362"):
        shot_of(tmp_path / "log.mat", outputs=(OutputChannel("motor", "count", "counts"),))
    with pytest.raises(DataError, match="D040"):
        shot_of(tmp_path / "log.mat", outputs=(OutputChannel("motor", "angle"),))


def test_lines_are_written_as_runs():
    assert format_lines(np.array([11, 12, 13, 20, 22, 24, 50])) == "11-13, 20-24 by 2, 50"
    assert format_lines(np.array([], int)) == ""


@pytest.fixture
def motor_bench(data_folder):
    return LogMapping(
        file=data_folder("motor_bench") / "MultisineTypeA.mat",
        sampling_period_s=4e-4,
        drop_periods=1,
        time=TimeChannel("time", "us"),
        inputs=(InputChannel("motor", "iq_adx", "A", normalised=True),),
        outputs=(OutputChannel("motor", "theta_mx"), OutputChannel("load", "theta_my", sign=-1)),
    )


def import_bench(mapping, samples_per_period=2500, periods=19):
    return import_log(
        mapping,
        samples_per_period=samples_per_period,
        periods=periods,
        excited_lines=np.arange(11, 251),
        configurations=np.zeros((1, 1)),
    )


def test_the_motor_bench_is_imported(motor_bench):
    record = import_bench(motor_bench)
    assert record.inputs.shape == (1, 1, 1, 19, 2500, 1)
    assert record.input_channels[0].unit == "A"
    spectrum = np.fft.rfft(record.outputs.mean(axis=3)[0, 0, 0], axis=0)[11:251]
    ratio = spectrum[:, 1] / spectrum[:, 0]
    assert np.abs(np.angle(ratio[:20])).max() < 0.2
    np.testing.assert_allclose(np.abs(ratio[:5]), 1 / (1 - (np.arange(11, 16) / 53.97) ** 2), rtol=0.05)


@pytest.mark.parametrize("stated", [2499, 2501])
def test_the_motor_bench_with_a_period_off_by_one_is_refused(motor_bench, stated):
    with pytest.raises(DataError, match=f"repeats every 2500 samples \\(1 s\\), not every {stated}"):
        import_bench(motor_bench, stated, periods=18)

"""Single findings of a log: time, flat tops, gaps, resolution, period, names, relations."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from robid.logs.inspection.contents import Column
from robid.logs.inspection.excitation import Shared, carrying_lines, measure_period, shorten, unsettled
from robid.logs.inspection.names import read_name, read_names
from robid.logs.inspection.quality import judge
from robid.logs.inspection.relations import compare, spectrum_of
from robid.logs.inspection.sampling import find_sampling

N, STEP = 6000, 1e-3
TIME = np.arange(N) * STEP
RNG = np.random.default_rng(5)
NOISE = RNG.normal(size=N)
SLOW = sosfilt(butter(2, 0.02, output="sos"), NOISE)


@pytest.mark.parametrize(
    ("name", "unit", "factor", "scalars", "found_unit", "stated"),
    [
        ("t", "", 1.0, {}, "s", False),
        ("time [ms]", "", 1e3, {}, "ms", True),
        ("Time", "s", 1.0, {}, "s", True),
        ("time", "", 1e6, {"fs": 1000.0}, "us", True),
        ("meas.X.Data", "", 1.0, {"meas.Capture.SamplingPeriod": 1e-3}, "s", True),
        ("/joint_states.header.stamp", "s", 1.0, {}, "s", True),
    ],
)
def test_the_time_is_found_with_its_unit(name, unit, factor, scalars, found_unit, stated):
    stamps = np.round(TIME * factor, 9)
    columns = [Column("torque", NOISE), Column("counter", np.arange(float(N))), Column(name, stamps, unit)]
    found = find_sampling(columns, scalars)
    assert (found.variable, found.unit, found.is_stated) == (name, found_unit, stated)
    assert found.step_s == pytest.approx(STEP, rel=1e-12)


def test_gaps_jitter_and_steps_back_are_told():
    kept = np.delete(np.arange(N), np.arange(1000, 1100))
    stamps = TIME[kept] + 1e-4 * RNG.uniform(-1, 1, len(kept))
    found = find_sampling([Column("time", stamps, "s")], {})
    assert (found.gaps, found.first_gap, found.missing, found.backward) == (1, 999, 100, 0)
    stamps[3000] = stamps[2999]
    assert find_sampling([Column("time", stamps, "s")], {}).backward == 1
    assert 0.1 < found.jitter < 1.2


def test_without_a_time_a_number_of_the_log_or_the_user_tells_the_step():
    columns = [Column("torque", NOISE), Column("rising", SLOW + 100 * TIME)]
    assert find_sampling(columns, {"Ts": 2e-3}).step_s == 2e-3
    assert find_sampling(columns, {"fs": 500.0}, 1e-3).step_s == 1e-3
    assert find_sampling(columns, {"mass": 2e-3}).step_s is None


def test_clipped_signals_are_saturated_and_coarse_or_slow_ones_are_not():
    clipped = judge(np.clip(SLOW, -0.1, 0.1))
    assert clipped.saturated == pytest.approx(np.mean(np.abs(SLOW) >= 0.1), rel=1e-6)
    encoder = 0.01 * np.round(np.sin(2 * np.pi * TIME) / 0.01)
    assert judge(encoder).saturated == judge(SLOW).saturated == judge(np.sin(2 * np.pi * TIME)).saturated == 0


@pytest.mark.parametrize("step", [2 * np.pi / 4096, 1e-3, 0.25])
def test_the_resolution_is_that_of_the_encoder(step):
    values = step * np.round(30 * SLOW / step) + 7.3
    assert judge(values).resolution == pytest.approx(step, rel=1e-4)


def test_continuous_signals_have_no_resolution():
    assert judge(NOISE).resolution is None
    assert judge(NOISE.astype(np.float32).astype(float)).resolution is None
    assert judge(np.cumsum(SLOW)).resolution is None


def test_missing_dead_and_still_signals_are_told():
    holed = NOISE.copy()
    holed[[50, 51, 52, 90]] = np.nan
    found = judge(holed)
    assert (found.missing, found.first_missing, found.longest_missing) == (4, 50, 3)
    assert judge(np.full(N, 3.0)).is_dead
    assert judge(np.where(NOISE > 0, 1.0, 2.0)).values == 2
    assert judge(np.full(N, np.nan)).missing == N
    assert judge((300 * TIME) % 360 - 180).turns == 4


@pytest.mark.parametrize("period", [250, 1234, 2999])
def test_the_period_is_found_without_a_hint(period):
    wave = RNG.normal(size=period)
    signal = np.tile(wave, 40)[123 : 123 + 5 * period] + 0.05 * RNG.normal(size=5 * period)
    assert measure_period(signal).samples == pytest.approx(period, abs=0.05)
    assert measure_period(RNG.normal(size=5 * period)).samples is None


def test_a_long_signal_is_measured_on_a_part_of_its_samples():
    wave = sosfilt(butter(2, 0.02, output="sos"), RNG.normal(size=30_000))
    assert measure_period(np.tile(wave, 10)).samples == pytest.approx(30_000, abs=2)


def test_a_period_that_holds_several_is_shortened():
    shared, lines = shorten(Shared(1000.0, 0.02, 5.5, ("tau",)), np.array([4, 8, 20]))
    assert (shared.samples, shared.held, lines.tolist()) == (250.0, 22.0, [1, 2, 5])
    kept, _ = shorten(shared, np.array([3, 6]))
    assert kept.samples == 250.0


def test_lines_with_energy_and_a_transient_are_found():
    lines = np.arange(3, 60, 4)
    phase = RNG.uniform(0, 2 * np.pi, len(lines))
    wave = np.cos(2 * np.pi * np.outer(np.arange(500), lines) / 500 + phase).sum(axis=1)
    blocks = np.tile(wave, (6, 1)) + 0.01 * RNG.normal(size=(6, 500))
    assert carrying_lines([blocks]).tolist() == lines.tolist()
    assert unsettled(blocks) == 0
    blocks[0] += np.exp(-np.arange(500) / 50)
    assert unsettled(blocks) == 1
    blocks[1] += 0.5 * np.exp(-np.arange(500) / 50)
    assert unsettled(blocks) == 2


@pytest.mark.parametrize(
    ("name", "unit", "role", "by", "commanded", "side", "joint", "written"),
    [
        ("tau_3", "", "torque", "name", None, "", "3", ""),
        ("MotorTorque[Nm]", "", "torque", "unit", None, "motor", "", "N m"),
        ("iq_ref", "", "current", "name", True, "", "", ""),
        ("I_act", "mA", "current", "unit", False, "", "", "mA"),
        ("/joint_states.position[elbow]", "", "position", "name", None, "", "elbow", ""),
        ("/joint_states.effort[0]", "", "torque", "name", None, "", "0", ""),
        ("theta(:,2)", "", "angle", "name", None, "", "2", ""),
        ("load_angle", "°", "angle", "unit", None, "arm", "", "deg"),
        ("q2", "", "angle", "short", None, "", "2", ""),
        ("dq2", "", "speed", "name", None, "", "2", ""),
        ("theta_dot_1", "", "speed", "name", None, "", "1", ""),
        ("theta_ddot_2", "", "acceleration", "name", None, "", "2", ""),
        ("omega_dot3", "", "acceleration", "name", None, "", "3", ""),
        ("x_dot", "", "speed", "short", None, "", "", ""),
        ("tau_dot_1", "", "other", "name", None, "", "1", ""),
        ("n_ist", "1/min", "speed", "unit", False, "", "", "rpm"),
        ("v_soll", "mm/s", "speed", "unit", True, "", "", "mm/s"),
        ("motor_temperature", "°C", "other", "unit", None, "motor", "", "degC"),
        ("log.Y(3).Data", "", "", "", None, "", "", ""),
        ("Model/Drive/axis_current_setpoint", "", "current", "name", True, "", "", ""),
        ("theta", "V", "angle", "name", None, "", "", "V"),
        ("ai0", "V", "voltage", "unit", None, "", "0", "V"),
        ("banana", "", "", "", None, "", "", ""),
    ],
)
def test_names_and_units_say_what_signals_are(name, unit, role, by, commanded, side, joint, written):
    hint = read_name(Column(name, NOISE, unit))
    assert (hint.role, hint.by, hint.commanded, hint.side) == (role, by, commanded, side)
    assert (hint.joint, hint.unit) == (joint, written)


@pytest.mark.parametrize(
    ("name", "role", "joint", "unit", "side"),
    [
        ("q_deg(:,1)", "angle", "1", "deg", ""),
        ("q_deg(2,:)", "angle", "2", "deg", ""),
        ("act_vel_deg_per_s_2", "speed", "2", "deg/s", ""),
        ("acc_rad_s_2", "acceleration", "", "rad/s^2", ""),
        ("speed_rad_s", "speed", "", "rad/s", ""),
        ("Winkel_Motor_Grad", "angle", "", "deg", "motor"),
        ("Moment_mNm", "torque", "", "mN m", ""),
        ("Motordrehzahl [U/min]", "speed", "", "rpm", "motor"),
        ("n_ist [min-1]", "speed", "", "rpm", ""),
        ("Lastwinkel [°]", "angle", "", "deg", "arm"),
        ("Achse3_Istposition_Grad", "angle", "3", "deg", ""),
        ("couple moteur [N.m]", "torque", "", "N m", "motor"),
        ("vitesse_tr_min", "speed", "", "rpm", ""),
        ("accélération [m/s²]", "acceleration", "", "m/s^2", ""),
        ("Strom (A)", "current", "", "A", ""),
        ("current_A", "current", "", "A", ""),
        ("x [nm]", "position", "", "nanometre", ""),
        ("M [Ncm]", "torque", "", "N cm", ""),
        ("speed [rps]", "speed", "", "turn/s", ""),
        ("Torque [Nm](2)", "torque", "2", "N m", ""),
        ("pos [inc]", "position", "", "counts", ""),
        ("J1_A", "", "1", "", ""),
        ("tau_A", "torque", "", "", ""),
        ("q_m", "angle", "", "", ""),
        ("/joint_states.effort[A]", "torque", "A", "", ""),
        ("/joint_states.position[m]", "position", "m", "", ""),
        ("torque [%]", "torque", "", "", ""),
        ("Moment [MNm]", "torque", "", "", ""),
    ],
)
def test_units_at_the_end_of_names_are_read_and_joints_are_none(name, role, joint, unit, side):
    hint = read_name(Column(name, NOISE))
    assert (hint.role, hint.joint, hint.unit, hint.side) == (role, joint, unit, side)


def test_letters_of_joints_are_told_by_their_neighbours():
    hints = read_names([Column(name, NOISE) for name in ("cur_A", "cur_B", "pos_A", "pos_B")])
    assert [one.unit for one in hints] == [""] * 4
    assert [one.joint for one in hints] == ["a", "b", "a", "b"]
    hints = read_names([Column(name, NOISE) for name in ("effort[A]", "effort[N]", "position[A]", "position[N]")])
    assert [(one.role, one.joint, one.unit) for one in hints[:2]] == [("torque", "A", ""), ("torque", "N", "")]


def test_names_that_say_nothing_leave_it_to_the_name_of_the_log():
    columns = [Column(f"Joint_{i}", NOISE, source="pos_read_data") for i in (1, 2)]
    columns += [Column(f"Joint_{i}", NOISE, source="curr", file=Path("curr.csv")) for i in (1, 2)]
    assert [(hint.role, hint.by, hint.joint) for hint in read_names(columns)] == [
        *(("position", "file", "1"), ("position", "file", "2")),
        *(("current", "file", "1"), ("current", "file", "2")),
    ]


@pytest.mark.parametrize(("factor", "late"), [(1.0, 0), (-9.55, 3)])
def test_a_derivative_is_told_with_factor_sign_and_delay(factor, late):
    speed = sosfilt(butter(4, 0.05, output="sos"), NOISE)
    angle = np.cumsum(speed) * STEP
    measured = factor * np.roll(speed, late)
    like = compare(spectrum_of(angle, STEP), spectrum_of(measured, STEP), 1, STEP)
    assert like.correlation > 0.99
    assert like.factor == pytest.approx(factor, rel=0.02)
    assert like.delay == pytest.approx(late + 0.5, abs=0.05)
    other = sosfilt(butter(4, 0.05, output="sos"), RNG.normal(size=N))
    assert compare(spectrum_of(angle, STEP), spectrum_of(other, STEP), 1, STEP).correlation < 0.5


def test_binary_noise_drives_and_a_flag_does_not():
    assert not judge(np.sign(NOISE)).is_still
    assert judge(np.repeat([0.0, 1.0, 0.0], N // 3)).is_still


@pytest.mark.parametrize(
    ("name", "unit"), [("trq_mNm", "mN m"), ("Force_kN", "kN"), ("phi1_mrad", "mrad"), ("torque_kNm", "kN m")]
)
def test_names_end_with_units_that_have_prefixes(name, unit):
    assert read_name(Column(name, NOISE)).unit == unit


def test_equal_steps_without_a_name_are_a_time_and_counters_are_none():
    counter, noise = Column("1", np.arange(float(N))), Column("3", NOISE)
    found = find_sampling([counter, Column("2", np.round(TIME, 9)), noise], {})
    assert (found.variable, found.unit, found.is_stated, found.step_s) == ("2", "s", False, STEP)
    assert find_sampling([counter, noise, Column("ref_angle", TIME)], {}).step_s is None


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns", ""])
@pytest.mark.parametrize("value", [0.0, 17.0])
def test_what_never_changes_is_no_clock(unit, value):
    still = Column(f"delay [{unit}]" if unit else "time", np.full(N, value), unit)
    assert find_sampling([still, Column("torque", NOISE)], {}).step_s is None
    assert find_sampling([still, Column("t", TIME, "s"), Column("torque", NOISE)], {}).step_s == pytest.approx(STEP)


@pytest.mark.parametrize("name", ["X", "X_Value", "rec.X{1}.Data", "3"])
def test_an_even_ramp_is_a_clock_whatever_letter_it_has(name):
    found = find_sampling([Column(name, TIME / 4), Column("torque", NOISE)], {})
    assert (found.variable, found.unit, found.is_stated) == (name, "s", False)
    assert found.step_s == pytest.approx(STEP / 4)


@pytest.mark.parametrize(("step", "likely"), [(0.0625, ("s", "ms")), (0.2, ("s", "ms")), (1e-3, ()), (4.0, ())])
def test_a_time_whose_unit_nothing_tells_stays_open(step, likely):
    columns = [Column("time", step * np.arange(N)), Column("torque", NOISE)]
    found = find_sampling(columns, {})
    assert found.likely == likely
    assert (found.step_s is None) == bool(likely)
    known = find_sampling(columns, {}, step * 1e-3)
    assert (known.unit, known.step_s) == ("ms", pytest.approx(step * 1e-3))


def test_the_same_time_again_is_no_signal():
    assert find_sampling([Column("exp1.t", TIME), Column("exp2.t", TIME)], {}).others == ("exp2.t",)


@pytest.mark.parametrize(("unit", "seconds"), [("min", 60.0), ("h", 3600.0), ("ms", 1e-3), ("minutes", 60.0)])
def test_a_stated_unit_of_time_is_taken(unit, seconds):
    time = 1e-3 * np.arange(2000) / seconds
    found = find_sampling([Column("time", time, unit), Column("torque", np.sin(time), "N m")], {})
    assert found.is_stated
    assert found.step_s == pytest.approx(1e-3)


@pytest.mark.parametrize(("unit", "step"), [("100us", 10.0), ("fortnights", 1e-9), ("", 1e-3 / 86400)])
def test_a_unit_of_time_that_is_not_known_is_not_guessed(unit, step):
    time = step * np.arange(2000)
    found = find_sampling([Column("time", time, unit), Column("torque", np.sin(time), "N m")], {})
    assert found.step_s is None
    assert found.doubt

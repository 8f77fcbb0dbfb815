"""What is proposed for logs that nobody designed for the import."""

import numpy as np
import pytest

from robid.logs.inspection.findings import Findings, inspect_log

N, STEP = 8000, 1e-3
TIME = STEP * np.arange(N)


def inspected(folder, columns: dict[str, np.ndarray]) -> Findings:
    file = folder / "log.csv"
    table = np.stack([TIME, *columns.values()], axis=1)
    np.savetxt(file, table, delimiter=",", header=",".join(["time [s]", *columns]), comments="")
    return inspect_log([file])


def test_binary_noise_is_an_input_and_its_period_is_found(tmp_path):
    period = np.sign(np.random.default_rng(1).normal(size=1000))
    torque = np.tile(period - period.mean(), N // 1000)
    motion = np.cumsum(np.cumsum(torque)) * STEP**2
    made = inspected(tmp_path, {"torque [Nm]": torque, "angle [rad]": motion}).proposal
    assert [one.signal.name for one in made.inputs] == ["torque [Nm]"]
    assert made.excitation is not None
    assert made.excitation.settings["period_s"] == 1.0


def test_accelerations_in_g_are_scaled(tmp_path):
    force = np.random.default_rng(2).normal(size=N)
    made = inspected(tmp_path, {"force [N]": force, "accel [g]": 0.1 * force}).proposal
    assert made.outputs[0].settings["unit"] == "m/s^2"
    assert made.outputs[0].settings["scale"] == pytest.approx(9.80665)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [2, 8])
def test_whole_periods_are_all_there_whatever_noise_makes_of_their_length(tmp_path, seed, count):
    generator = np.random.default_rng(seed)
    spectrum = np.zeros(N // count // 2 + 1, complex)
    spectrum[1:100] = np.exp(2j * np.pi * generator.random(99))
    period = np.fft.irfft(spectrum, N // count) * N
    torque = np.tile(period, count) + 1e-3 * period.std() * generator.normal(size=N)
    motion = np.tile(period, count) + 10 * period.std() * np.exp(-TIME / 0.2)
    found = inspected(tmp_path, {"torque [Nm]": torque, "angle [rad]": motion})
    assert found.shared is not None
    assert found.shared.held == count
    made = found.proposal
    assert (made.periods, made.drop_periods, made.take_last) == ((2, 0, False) if count == 2 else (6, 2, False))


@pytest.mark.parametrize("after", [2300, 4100, 6600])
def test_a_period_is_found_in_spite_of_lost_samples(tmp_path, after):
    generator = np.random.default_rng(after)
    spectrum = np.zeros(501, complex)
    spectrum[1:100] = np.exp(2j * np.pi * generator.random(99))
    period = np.fft.irfft(spectrum, 1000)
    torque = np.delete(np.tile(period, 9), slice(after, after + 7))[:N]
    motion = torque + 0.01 * period.std() * generator.normal(size=N)
    found = inspected(tmp_path, {"torque [Nm]": torque, "angle [rad]": motion})
    assert found.shared is not None
    assert found.shared.whole == 1000


def test_what_differs_from_place_to_place_has_no_period(tmp_path):
    generator = np.random.default_rng(6)
    noise = generator.normal(size=N)
    noise[:2000] = np.tile(noise[:500], 4)
    found = inspected(tmp_path, {"torque [Nm]": noise, "angle [rad]": np.cumsum(noise)})
    assert found.shared is None


def test_stamps_rounded_to_more_than_a_step_tell_the_sampling_period(tmp_path):
    force = np.random.default_rng(3).normal(size=N)
    file = tmp_path / "log.csv"
    table = np.stack([np.round(TIME / 2, 3), force, np.cumsum(force)], axis=1)
    np.savetxt(file, table, delimiter=",", header="time [s],force [N],way [m]", comments="")
    sampling = inspect_log([file]).sampling
    assert sampling.variable == "time [s]"
    assert sampling.step_s == STEP / 2
    assert "rounded" in sampling.told_by


def test_a_period_that_lacks_two_samples_is_not_proposed(tmp_path):
    period = np.random.default_rng(8).normal(size=2000)
    torque = np.tile(period, 4)
    file = tmp_path / "log.csv"
    table = np.stack([TIME[:-2], torque[:-2], np.cumsum(torque)[:-2]], axis=1)
    np.savetxt(file, table, delimiter=",", header="time [s],torque [Nm],angle [rad]", comments="")
    made = inspect_log([file]).proposal
    assert (made.periods or 0) + made.drop_periods == 3


def multisine(moments: np.ndarray, highest: int, seed: int = 4) -> np.ndarray:
    """Waves of 1 to some Hz at any moments [s]."""
    lines = np.arange(1, highest)
    phases = 2 * np.pi * np.random.default_rng(seed).random(len(lines))
    return np.cos(2 * np.pi * np.outer(moments, lines) + phases).sum(axis=1)


@pytest.mark.parametrize("kind", ["jitter", "dropouts", "gap"])
def test_an_uneven_clock_is_brought_to_steps_of_which_a_period_has_a_whole_number(tmp_path, kind):
    generator = np.random.default_rng(5)
    moments = TIME + 1e-3 * generator.uniform(-0.4, 0.4, N)
    if kind == "dropouts":
        moments = np.delete(moments, generator.choice(N, N // 6, replace=False))
    if kind == "gap":
        moments = np.delete(moments, slice(3000, 3100))
    torque = multisine(moments, 20)
    table = np.stack([moments, torque, multisine(moments - 0.05, 20)], axis=1)
    np.savetxt(
        tmp_path / "log.csv", table, fmt="%.12g", delimiter=",", header="time [s],torque [Nm],q [rad]", comments=""
    )
    found = inspect_log([tmp_path / "log.csv"])
    made = found.proposal
    assert made.resample == "time"
    assert made.excitation is not None
    assert made.excitation.settings["period_s"] == pytest.approx(1, rel=1e-6)
    whole = 1 / found.step_s
    assert whole == pytest.approx(round(whole), rel=1e-9)
    assert (made.part_s is not None) == (kind == "gap")
    if made.part_s is not None:
        assert made.part_s[1] - made.part_s[0] == pytest.approx(4.9, abs=0.01)


def test_a_log_that_loses_a_row_here_and_there_is_used_whole(tmp_path):
    generator = np.random.default_rng(7)
    torque = multisine(TIME, 20)
    table = np.stack([TIME, torque + 0.1 * torque.std() * generator.standard_normal(N), multisine(TIME, 20, 6)], axis=1)
    table = np.delete(table, generator.choice(np.arange(1, N), N // 200, replace=False), axis=0)
    header = "time [s],torque [Nm],q [rad]"
    np.savetxt(tmp_path / "log.csv", table, fmt="%.12g", delimiter=",", header=header, comments="")
    made = inspect_log([tmp_path / "log.csv"]).proposal
    assert (made.resample, made.part_s) == ("time", None)
    assert made.periods == N // 1000


def test_units_follow_from_a_derivative_and_contradictions_are_told(tmp_path):
    speed = multisine(TIME, 20)
    angle = np.cumsum(speed) * STEP
    torque = {"torque [Nm]": np.gradient(speed, STEP)}
    made = inspected(tmp_path, {**torque, "angle": np.rad2deg(angle), "speed": speed}).proposal
    assert made.outputs[0].settings["unit"] == "deg"
    found = inspected(tmp_path, {**torque, "angle [deg]": np.rad2deg(angle), "speed [deg/s]": speed})
    assert found.proposal.outputs[0].settings["unit"] == "deg"
    assert any("one of them is wrong" in one for one in found.proposal.outputs[0].checks)
    sound = inspected(tmp_path, {**torque, "angle [deg]": np.rad2deg(angle), "speed [rad/s]": speed})
    assert not any("wrong" in one for one in sound.proposal.outputs[0].checks)


@pytest.mark.parametrize(
    ("name", "unit", "scale"),
    [("pos [inc]", "counts", None), ("pos [V]", "V", None), ("pos [%]", "%", None), ("pos [cm]", "mm", 10.0)],
)
def test_a_size_that_nobody_stated_is_no_key(tmp_path, name, unit, scale):
    torque = multisine(TIME, 20)
    settings = inspected(tmp_path, {"torque [Nm]": torque, name: np.round(1e3 * torque)}).proposal.outputs[0].settings
    assert settings["unit"] == unit
    assert settings.get("scale") == scale
    assert "counts_per_turn" not in settings


@pytest.mark.parametrize("kind", ["motion", "small", "multisine", "beside a slow motion"])
def test_only_a_large_slow_motion_of_several_joints_is_for_a_rigid_model(tmp_path, kind):
    """A slow motion that carries an excitation past Coulomb friction is none: the torques do not follow it."""
    lines = np.array([1, 2, 3, 5]) if kind in ("motion", "small") else np.arange(4, 160, 3)
    columns, rng = {}, np.random.default_rng(6)
    for joint, size in (("a", 1.0), ("b", 0.6)):
        angles = 2 * np.pi * lines[:, None] / 2 * TIME + rng.uniform(0, 2 * np.pi, (len(lines), 1))
        acceleration = np.sin(angles).sum(axis=0)
        motion = -(np.sin(angles) / (np.pi * lines[:, None]) ** 2).sum(axis=0)
        motion *= (0.01 if kind == "small" else 1.0) * size / np.ptp(motion)
        slow = 2 * np.sin(np.pi * TIME) if kind == "beside a slow motion" else 0.0
        columns |= {f"torque_{joint} [Nm]": acceleration + 0.1 * np.sign(slow), f"angle_{joint} [rad]": motion + slow}
    made = inspected(tmp_path, columns).proposal
    assert len(made.inputs) == len(made.outputs) == 2
    assert made.is_motion == (kind == "motion")


def cobot(names: dict[str, str], labels=tuple("0123")) -> dict[str, np.ndarray]:
    """A log of joints that move far and slowly, its names made of patterns for what it holds, in their order."""
    rng = np.random.default_rng(7)
    phases = rng.uniform(0, 2 * np.pi, len(labels))
    angles = np.sin(np.pi * TIME + phases[:, None]) + 0.3 * np.sin(3.3 * np.pi * TIME + 2 * phases[:, None])
    speeds, noise = np.gradient(angles, STEP, axis=1), 1e-3 * rng.normal(size=(5, *angles.shape))
    torques = np.gradient(speeds, STEP, axis=1) + 2 * speeds + 20 * np.sin(angles)
    held = {
        "angle": angles,
        "speed": speeds + noise[0],
        "desired angle": angles + 2e-3 * speeds,
        "torque": torques + noise[1],
        "desired torque": 0.2 * torques + noise[2],
        "external torque": 0.1 * torques + noise[3],
    }
    return {
        pattern.replace("#", label): held[kind][row]
        for kind, pattern in names.items()
        for row, label in enumerate(labels)
    }


FRANKA = {"angle": "q[#]", "speed": "dq[#]", "desired angle": "q_d[#]"}
FRANKA |= {"torque": "tau_J[#]", "desired torque": "tau_J_d[#]", "external torque": "tau_ext_hat_filtered[#]"}
UNDERSCORES = {kind: name.replace("[#]", "_#") for kind, name in FRANKA.items()}
LABELS = ("base", "shoulder", "elbow", "wrist")


@pytest.mark.parametrize("names", [FRANKA, dict(reversed(FRANKA.items())), UNDERSCORES])
def test_an_index_in_brackets_is_no_unit_and_what_is_desired_or_estimated_was_not_measured(tmp_path, names):
    made = inspected(tmp_path, cobot(names)).proposal
    assert [one.signal.name for one in made.inputs] == [names["torque"].replace("#", str(row)) for row in range(4)]
    assert [one.signal.name for one in made.outputs] == [names["angle"].replace("#", str(row)) for row in range(4)]
    assert {one.settings["unit"] for one in (*made.inputs, *made.outputs)} == {"N m", "rad"}


def test_labels_in_brackets_behind_one_name_are_joints_and_units_stay_units(tmp_path):
    names = {"angle": "position[#]", "torque": "effort[#]"}
    made = inspected(tmp_path, cobot(names, LABELS)).proposal
    assert [one.name for one in made.inputs] == list(LABELS)
    assert {one.settings["unit"] for one in (*made.inputs, *made.outputs)} == {"N m", "rad"}
    torque = np.random.default_rng(2).normal(size=N)
    angle = np.cumsum(np.cumsum(torque)) * STEP**2
    made = inspected(tmp_path, {"torque [digits]": torque, "torque [%]": 2 * torque, "angle [deg]": angle}).proposal
    assert made.inputs[0].settings["unit"] == "digits"


def test_a_force_of_a_joint_that_slides_stands_beside_the_torques_of_the_others(tmp_path):
    names = {"angle": "pos_#[rad]", "torque": "effort_#[Nm]"}
    columns = cobot(names, LABELS)
    slides = {name: name.replace("[rad]", "[m]").replace("[Nm]", "[N]") for name in columns if "elbow" in name}
    made = inspected(tmp_path, {slides.get(name, name): values for name, values in columns.items()}).proposal
    assert [one.name for one in made.inputs] == [one.name for one in made.outputs] == list(LABELS)
    assert [one.settings["unit"] for one in made.inputs] == ["N m", "N m", "N", "N m"]

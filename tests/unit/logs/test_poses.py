"""Logs of commanded and measured poses: angles that wrap, a tilted home, chirps of one channel after the other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robid.errors import DataError, SettingsError
from robid.logs.columns import check_turns
from robid.logs.importing import import_log, import_shot, join_experiments, join_shots
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import PoseOptions
from robid.signals.pose import POSE
from robid.signals.quantities import describe

STEP, N_SAMPLE, PERIODS = 0.012, 500, 4
LINES = np.arange(1, 60)
ABSOLUTE = PoseOptions()
HOME = np.array([1200.0, -400.0, 900.0, 179.9, 20.0, -60.0])  # mm and degrees


def chirp_of(axis, size=1.0):
    """Four periods of a chirp in one channel of a displacement (n_sample, 6) [mm, deg]."""
    share = np.arange(N_SAMPLE) / N_SAMPLE
    wave = size * np.sin(np.pi * share) * np.sin(2 * np.pi * (share + 28 * share**2))
    moved = np.zeros((N_SAMPLE * PERIODS, 6))
    moved[:, axis] = np.tile(wave, PERIODS)
    return moved


def absolute(moved, home=HOME):
    """Poses X Y Z [mm], A B C [deg] within +-180, of displacements in the tool's frame."""
    tool = Rotation.from_euler("ZYX", home[3:], degrees=True)
    turned = tool * Rotation.from_euler("ZYX", moved[:, 3:], degrees=True)
    return np.hstack([home[:3] + tool.apply(moved[:, :3]), turned.as_euler("ZYX", degrees=True)])


def unit_of(name):
    return "mm" if name in "XYZ" else "deg"


def write(folder, inputs, outputs, name="log.csv"):
    table = np.hstack([inputs, outputs])
    header = ",".join([*(f"sol_{each}" for each in POSE), *(f"ist_{each}" for each in POSE)])
    np.savetxt(folder / name, table, delimiter=",", header=header, comments="")
    return folder / name


def mapping_of(file, pose=ABSOLUTE, **changes):
    kind = {"quantity": "position_command", "side": "tool"}
    return LogMapping(
        file=file,
        format="csv",
        sampling_period_s=STEP,
        inputs=tuple(InputChannel(name, f"sol_{name}", unit_of(name), **kind) for name in POSE),
        outputs=tuple(OutputChannel(name, f"ist_{name}", unit_of(name), side="tool") for name in POSE),
        pose=pose,
        **changes,
    )


def bring(mapping, periods=PERIODS):
    return import_log(
        mapping,
        samples_per_period=N_SAMPLE,
        periods=periods,
        excited_lines=LINES,
        configurations=np.zeros((1, 0)),
    )


@pytest.mark.parametrize("axis", [0, 3])
def test_a_chirp_along_a_tilted_tool_answers_in_its_own_channel(tmp_path, axis):
    moved = chirp_of(axis)
    record = bring(mapping_of(write(tmp_path, moved, absolute(moved))))
    assert record.inputs.shape == record.outputs.shape == (1, 1, 1, PERIODS, N_SAMPLE, 6)
    np.testing.assert_allclose(record.outputs, record.inputs, atol=1e-9)
    assert describe(record.input_channels) == "tool position command (X, Y, Z, A, B, C)"
    assert describe(record.output_channels) == "tool position (X, Y, Z), tool angle (A, B, C)"
    assert "home pose 1.2, -0.4, 0.9, 179.9, 20, -60" in " ".join(record.notes)


def test_absolute_commands_become_displacements_too(tmp_path):
    moved = chirp_of(1)
    file = write(tmp_path, absolute(moved), absolute(0.5 * moved))
    record = bring(mapping_of(file, PoseOptions(absolute=("inputs", "outputs"))))
    np.testing.assert_allclose(record.inputs[0, 0, 0].reshape(-1, 6), 1e-3 * moved, atol=1e-9)
    np.testing.assert_allclose(record.outputs, 0.5 * record.inputs, atol=1e-9)


def test_a_stated_home_is_what_displacements_count_from(tmp_path):
    moved = chirp_of(2)
    moved[:, 2] += 5.0
    home = (*(1e-3 * HOME[:3]), *HOME[3:])
    record = bring(mapping_of(write(tmp_path, moved, absolute(moved)), PoseOptions(home=home)))
    np.testing.assert_allclose(record.output_offset, [[0, 0, 5e-3, 0, 0, 0]], atol=1e-9)


def test_angles_of_a_tool_do_not_jump_and_it_is_said(tmp_path):
    moved = chirp_of(3, size=2.0)
    file = write(tmp_path, moved, absolute(moved, np.array([0, 0, 0, 179.5, 0, 0])))
    record = bring(mapping_of(file, None))
    np.testing.assert_allclose(record.outputs[..., 3], record.inputs[..., 3], atol=1e-9)
    assert "`ist_A` jumped by a turn" in " ".join(record.notes)
    outputs = tuple(replace(one, unwrap=False) for one in mapping_of(file).outputs)
    as_it_is = bring(replace(mapping_of(file, None), outputs=outputs))
    assert np.ptp(as_it_is.outputs) > 6
    assert not as_it_is.notes


def test_joint_angles_are_unwrapped_on_request_alone():
    channel = OutputChannel("q", "q")
    assert not channel.unwraps
    assert replace(channel, unwrap=True).unwraps
    assert "does not belong to mm" in " ".join(replace(channel, unwrap=True, unit="mm").problems())


def test_commands_given_one_after_the_other_make_a_block(tmp_path):
    records = []
    for axis in range(6):
        moved = chirp_of(axis)
        records.append(bring(mapping_of(write(tmp_path, moved, absolute(moved), f"{axis}.csv"))))
    joined = join_experiments(records, 6)
    check_turns(joined, "log")
    assert joined.inputs.shape == (1, 1, 6, PERIODS, N_SAMPLE, 6)
    with pytest.raises(DataError, match="D047 No experiment moves C"):
        check_turns(join_experiments(records[:5], 5), "log")


def test_a_log_in_which_nothing_moves_is_refused(tmp_path):
    still = np.zeros((N_SAMPLE * PERIODS, 6))
    with pytest.raises(DataError, match="D046") as caught:
        bring(mapping_of(write(tmp_path, still, absolute(still))))
    assert str(caught.value).count("D046") == 2


def test_four_repeats_are_periods_of_one_log_or_shots_of_four(tmp_path):
    moved = chirp_of(0)
    whole = bring(mapping_of(write(tmp_path, moved, absolute(moved))))
    each = [
        import_shot(mapping_of(write(tmp_path, *(x[part] for x in (moved, absolute(moved)))), one_shot=True))
        for part in (slice(start, start + N_SAMPLE) for start in range(0, len(moved), N_SAMPLE))
    ]
    shots = join_shots(each)
    assert shots.outputs.shape == (1, 4, 1, 1, N_SAMPLE, 6)
    np.testing.assert_allclose(shots.outputs[0, :, 0, 0], whole.outputs[0, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"outputs": 5}, "outputs: S375 a pose has X Y Z in m or mm and A B C in rad or deg: C lacking"),
        ({"zero": 3.0}, "outputs: S376"),
    ],
)
def test_channels_that_make_no_pose_are_refused(tmp_path, change, told):
    mapping = mapping_of(tmp_path / "none.csv")
    outputs = mapping.outputs[: change.get("outputs", 6)]
    outputs = (replace(outputs[0], zero=change.get("zero", 0.0)), *outputs[1:])
    with pytest.raises(SettingsError) as caught:
        import_shot(replace(mapping, outputs=outputs))
    assert told in str(caught.value)


def test_a_stated_home_is_in_metres_and_degrees():
    expected = [1, 2, 3, np.pi, np.pi / 2, -np.pi / 2]
    np.testing.assert_allclose(PoseOptions(home=(1, 2, 3, 180, 90, -90)).stated, expected)
    assert PoseOptions().stated is None

"""What estimate-frf finds wrong with a record reaches the user."""

from dataclasses import replace

import numpy as np
import pytest

from default_campaign import CONFIGURATION, ROBOT
from frf_campaign import make_job, random_record, write_campaign
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.backends.map import make_map
from robid.errors import DataError
from robid.pipeline.estimate_frf import run
from robid.signals.quantities import motor_channels
from robid.signals.waveforms import time_signal


class Heard:
    """A progress that keeps what it is warned of."""

    def __init__(self):
        self.warnings = []

    def expect(self, total, unit, done=0):
        """Ignored."""

    def advance(self):
        """Ignored."""

    def warn(self, text):
        self.warnings.append(text)


def periodic_record(n_sample):
    """Six motors that follow a multisine with all lines of the band."""
    record = random_record(n_sample)
    generator, lines = np.random.default_rng(4), record.excited_lines
    shape = (2, *record.inputs.shape[1:3], lines.size, 6)
    spectrum = generator.standard_normal(shape[1:]) * np.exp(2j * np.pi * generator.random(shape[1:]))
    torque = time_signal(spectrum, lines, n_sample)[None, :, :, None]
    position = 1e-2 * torque  # a response, whatever it is, and one that is known
    shape = record.inputs.shape
    return replace(record, inputs=np.tile(torque, (1, 1, 1, 2, 1, 1)), outputs=np.broadcast_to(position, shape).copy())


def run_stage(tmp_path, record, n_conf=2):
    path, output, heard = tmp_path / "record.h5", tmp_path / "frf.h5", Heard()
    write_campaign(path, record, n_conf)
    with make_map("serial", 1) as parallel_map:
        run(replace(make_job(path, output, "none", parallel_map), progress=heard))
    return heard.warnings, frf_from_artifact(read_artifact(output, FRF)).notes


def test_findings_are_told_and_kept(tmp_path):
    record = periodic_record(512)
    record.outputs[0, 2, 3, :, :300, 1] = record.outputs[0, 2, 3, :, :1, 1]
    warnings, notes = run_stage(tmp_path, record)
    assert len([told for told in warnings if "stood still" in told]) == 1  # both configurations are at the same angles
    assert "axis2: the motor stood still for" in warnings[0]
    assert "realization 3, experiment 4" in warnings[0]
    assert warnings[0] in notes


def test_nothing_is_told_of_a_good_record(tmp_path):
    warnings, notes = run_stage(tmp_path, periodic_record(512))
    assert warnings == []
    assert not any(note.startswith("In the configuration") for note in notes)


def test_dropped_samples_stop_the_stage(tmp_path):
    record = periodic_record(512)
    record.outputs[0, 1, 2, 1, 200:-1] = record.outputs[0, 1, 2, 1, 201:]
    record.inputs[0, 1, 2, 1, 200:-1] = record.inputs[0, 1, 2, 1, 201:]
    with pytest.raises(DataError, match="realization 2, experiment 3: 1 sample missing in period 2 near sample 20"):
        run_stage(tmp_path, record, n_conf=1)


def test_angles_that_contradict_the_robot_file_are_told_and_not_kept(tmp_path):
    # A corrected robot file must not make the response stale, so nothing of this is in it.
    record, names = periodic_record(512), tuple(joint.name for joint in ROBOT.joints)
    offset = ROBOT.motor_per_arm @ CONFIGURATION
    placed = replace(
        record,
        configurations=CONFIGURATION[None],
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
    )
    sound, _ = run_stage(tmp_path, replace(placed, output_offset=offset[None]))
    offset[1] += ROBOT.joints[1].motor.gear_ratio * np.deg2rad(30.0)
    (tmp_path / "frf.h5").unlink()
    warnings, notes = run_stage(tmp_path, replace(placed, output_offset=offset[None]))
    told = (
        "Campaign estimation: axis_2: off by the same amount in every configuration (30 deg): this points to"
        " configurations that are swapped or mislabelled (F006)."
    )
    assert told in warnings
    assert not any("off by the same amount" in text for text in (*sound, *notes))

"""The rigid fit's rows against a loop over Pinocchio's regressor, and what they keep in memory."""

import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.linalg import lstsq
from scipy.signal import butter, sosfiltfilt

import rigid_rows
from default_campaign import ROBOT
from rigid_rows import OPTIONS, PERIOD_S, estimate, long_record
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.regression import huber_weights, robust_scale
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.links import COMPONENTS
from robid.robot.regressor.model import build_rigid_model
from robid.signals.filters import central_differences

pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")

N_SAMPLE = 1_000_000
_PINOCCHIO = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")


def pinocchio_chain():
    """The robot's links with the payload in Pinocchio, gravity included."""
    model, parent = pin.Model(), 0
    model.gravity = pin.Motion(np.concatenate([ROBOT.gravity_m_s2, np.zeros(3)]))
    for joint in ROBOT.joints:
        placement = pin.SE3(joint.rotation, joint.position_m)
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, joint.name)
    return model


def reference_columns(position):
    """Base columns (n_sample - 2, 6, n_base), arm-side columns by Pinocchio sample by sample."""
    full = build_rigid_model(ROBOT)
    base = find_base_parameters(full)
    names = [full.names[index] for index in base.columns]
    chain = pinocchio_chain()
    data = chain.createData()
    place = {f"{joint.name}.{part}": 10 * index + row for index, joint in enumerate(ROBOT.joints)
             for row, part in enumerate(_PINOCCHIO)}  # fmt: skip
    links = [index for index, name in enumerate(names) if name in place]
    chosen = [place[names[index]] for index in links]
    motor = np.ascontiguousarray(position[1:-1])
    velocity, acceleration = central_differences(position, PERIOD_S)
    arm = [np.ascontiguousarray(each @ ROBOT.arm_per_motor.T) for each in (motor, velocity, acceleration)]
    columns = np.zeros((len(motor), 6, len(names)))
    to_motor = ROBOT.arm_per_motor.T
    for sample, (q, v, a) in enumerate(zip(*arm, strict=True)):
        columns[sample, :, links] = (to_motor @ pin.computeJointTorqueRegressor(chain, data, q, v, a)[:, chosen]).T
    motions = {"motor_inertia": acceleration, "viscous": velocity, "coulomb": np.sign(velocity)}
    for index, name in enumerate(names):
        if index not in links:
            owner, _, kind = name.partition(".")
            joint = [each.name for each in ROBOT.joints].index(owner)
            columns[:, joint, index] = motions[kind][:, joint] if kind in motions else 1.0
    return columns


def reference(position, torque, steps):
    """Huber's estimate with every column filtered at full rate and dense least squares in each of so many steps."""
    low = butter(OPTIONS.position_order, OPTIONS.cut_hz, fs=1 / PERIOD_S, output="sos")
    columns = reference_columns(sosfiltfilt(low, position, axis=0))
    keep = butter(4, 0.8 / OPTIONS.decimation, output="sos")

    def decimated(signal):
        return sosfiltfilt(keep, np.ascontiguousarray(signal))[:: OPTIONS.decimation]

    shape = columns.shape[1:]
    rows = np.stack(
        [np.stack([decimated(columns[:, j, p]) for p in range(shape[1])], axis=1) for j in range(shape[0])], 1
    )
    right = np.stack([decimated(signal) for signal in torque[1:-1].T], axis=1)
    flat, goal = rows.reshape(-1, shape[1]), right.reshape(-1)
    found = lstsq(flat, goal, lapack_driver="gelsy", check_finite=False)[0]
    for _ in range(steps):
        residual = right - rows @ found
        scale = robust_scale(residual)
        root = np.sqrt(huber_weights(residual / scale, HuberOptions.bend)) / scale
        weighted = (rows * root[..., None]).reshape(flat.shape)
        found = lstsq(weighted, (right * root).reshape(-1), lapack_driver="gelsy", check_finite=False)[0]
    return found


def test_against_a_pinocchio_loop(keep):
    """A million samples; with one warm-up on a few of ours and Pinocchio's."""
    small = long_record(30_000)
    base, ours = estimate(*small)
    theirs = reference(*small, ours.iterations)
    well_known = np.abs(ours.parameters) > 20 * ours.standard_deviation
    np.testing.assert_allclose(ours.parameters[well_known], theirs[well_known], rtol=0.1)
    assert well_known.sum() > len(base.columns) / 2
    record = long_record(N_SAMPLE)
    seconds = []
    for _ in range(3):
        begun = time.perf_counter()
        _, ours = estimate(*record)
        seconds.append(time.perf_counter() - begun)
    begun = time.perf_counter()
    reference(*record, ours.iterations)
    other = time.perf_counter() - begun
    own = float(np.median(seconds))
    remark = f"(ours {own:.3g} s, reference {other:.3g} s, {ours.iterations} steps of Huber each; 3 rounds to 1)"
    keep("rigid.vs_pinocchio", other / own, remark)


def peak_bytes(n_sample):
    """By how much the estimate of so many samples raises a fresh process's memory."""
    command = [sys.executable, rigid_rows.__file__, str(n_sample)]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the memory is read from /proc")
def test_memory_of_four_times_the_samples(keep):
    one, four = peak_bytes(N_SAMPLE), peak_bytes(4 * N_SAMPLE)
    keep("rigid.memory_4_vs_1", four / one, f"({one / 1e6:.0f} MB, {four / 1e6:.0f} MB beside the samples)")


def test_component_names_are_pinocchios():
    assert set(_PINOCCHIO) == set(COMPONENTS)

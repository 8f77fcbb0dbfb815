"""What a record reached, against signals whose peaks and areas are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from rigid_robots import random_chain
from robid.robot.reached import hull_of, reached_in, reached_in_all
from robid.signals.quantities import Channel
from robid.signals.record import Record

PERIOD_S, N_SAMPLE = 1e-3, 4000
OMEGA = 2 * np.pi * np.array([3.0, 5.0])
ANGLE, TORQUE = np.array([2.0, 0.5]), np.array([10.0, -4.0])
REST = np.array([1.0, -2.0])


@pytest.fixture(scope="module")
def robot():
    made = random_chain(3, 2, slides=0.0)
    first, second = made.joints
    # The second joint moves with the first one's motor, too.
    return replace(made, joints=(first, replace(second, couplings={first.name: 0.004})))


def record_of(robot, *, side="motor", quantity="angle", scale=1.0):
    time = PERIOD_S * np.arange(N_SAMPLE)[:, None]
    # The torque leads the speed by a quarter: the plane of both is an ellipse.
    motion = ANGLE * np.sin(OMEGA * time) if quantity == "angle" else ANGLE * OMEGA * np.cos(OMEGA * time)
    torque = scale * TORQUE * np.sin(OMEGA * time)
    end, names = ".arm" if side == "arm" else "", [joint.name for joint in robot.joints]
    rest = REST
    if side == "arm":
        motion, torque, rest = (
            motion @ robot.arm_per_motor.T,
            torque @ robot.motor_per_arm,
            rest @ robot.arm_per_motor.T,
        )
    unit = "rad" if quantity == "angle" else "rad/s"
    return Record(
        PERIOD_S,
        inputs=torque[None, None, None, None],
        outputs=motion[None, None, None, None],
        output_offset=rest[None] if quantity == "angle" else np.zeros((1, 2)),
        input_channels=tuple(Channel(name + end, "torque", "N m", side) for name in names),
        output_channels=tuple(Channel(name + end, quantity, unit, side) for name in names),
    )


@pytest.mark.parametrize(("side", "quantity"), [("motor", "angle"), ("motor", "speed"), ("arm", "angle")])
def test_peaks_and_rms_of_sines(robot, side, quantity):
    found = reached_in(record_of(robot, side=side, quantity=quantity), robot)
    # Differences of a sine are smaller by sinc(w T).
    np.testing.assert_allclose(found.speed_peak, ANGLE * OMEGA, rtol=2e-3)
    np.testing.assert_allclose(found.speed_rms, ANGLE * OMEGA / np.sqrt(2), rtol=2e-3)
    np.testing.assert_allclose(found.torque_peak, np.abs(TORQUE), rtol=1e-4)
    np.testing.assert_allclose(found.torque_rms, np.abs(TORQUE) / np.sqrt(2), rtol=1e-4)
    for hull, area in zip(found.hulls, np.pi * ANGLE * OMEGA * np.abs(TORQUE), strict=True):
        x, y = hull.T
        assert abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2 == pytest.approx(area, rel=5e-3)
    if quantity == "angle":
        ratio = robot.arm_per_motor[0, 0]
        assert robot.arm_per_motor[0, 1] == 0 != robot.arm_per_motor[1, 0]
        ends = sorted([(REST + ANGLE)[0] * ratio, (REST - ANGLE)[0] * ratio])
        np.testing.assert_allclose([found.lowest[0], found.highest[0]], ends, rtol=1e-3)


def test_what_is_not_measured_is_not_said(robot):
    record = record_of(robot)
    current = tuple(replace(channel, quantity="current", unit="A") for channel in record.input_channels)
    found = reached_in(replace(record, input_channels=current), robot)
    assert np.isnan(found.torque_peak).all()
    assert np.isfinite(found.speed_peak).all()
    assert not any(len(hull) for hull in found.hulls)
    tool = tuple(replace(channel, side="tool") for channel in record.output_channels)
    assert reached_in(replace(record, output_channels=tool), robot) is None


def test_several_records_reach_what_the_larger_one_does(robot):
    small, large = (reached_in(record_of(robot, scale=scale), robot) for scale in (1.0, 3.0))
    both = reached_in_all([small, large])
    np.testing.assert_array_equal(both.torque_peak, large.torque_peak)
    np.testing.assert_array_equal(both.highest, np.maximum(small.highest, large.highest))
    for hull, inner in zip(both.hulls, small.hulls, strict=True):
        assert np.abs(hull[:, 1]).max() == pytest.approx(3 * np.abs(inner[:, 1]).max())


def test_a_line_has_no_hull():
    assert hull_of(*np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]]).T).shape == (0, 2)
    assert hull_of(*np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]).T).shape == (0, 2)
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [np.nan, 0.2]])
    assert sorted(map(tuple, hull_of(*square.T).tolist())) == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_a_hull_of_many_points_is_that_of_all_of_them():
    points = np.random.default_rng(2).normal(size=(5000, 2)) * [40.0, 3.0]
    corners = ConvexHull(points).vertices
    assert sorted(map(tuple, hull_of(*points.T).tolist())) == sorted(map(tuple, points[corners].tolist()))

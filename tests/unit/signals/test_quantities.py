"""Quantities, units and sides: what each unit is in SI, and who accepts which channels."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel, UnitName, input_problems
from robid.signals.quantities import (
    ACCELERATION,
    MOTOR_TORQUE,
    QUANTITIES,
    UNITS,
    Channel,
    QuantityName,
    UsableChannels,
    describe,
    motor_channels,
    response_unit,
)
from tolerances import IDENTITY


def channel_of(**said):
    return OutputChannel("q", "x", **said)


@pytest.mark.parametrize(
    ("unit", "number", "si", "value"),
    [
        ("kN m", 0.4, "N m", 400.0),
        ("mA", 250.0, "A", 0.25),
        ("N", 3.0, "N", 3.0),
        ("mm", 1500.0, "m", 1.5),
        ("turn", 0.25, "rad", np.pi / 2),
        ("deg", 180.0, "rad", np.pi),
        ("deg/s", 90.0, "rad/s", np.pi / 2),
        ("rpm", 60.0, "rad/s", 2 * np.pi),
        ("mm/s", 20.0, "m/s", 0.02),
    ],
)
def test_a_unit_is_brought_to_si(unit, number, si, value):
    channel = channel_of(unit=unit)
    assert channel.problems() == []
    assert channel.channel.unit == si
    assert number * channel.factor == pytest.approx(value, rel=1e-14)
    assert number * channel_of(unit=unit, scale=2.0, sign=-1).factor == pytest.approx(-2 * value, rel=1e-14)


def test_counts_have_the_size_that_is_stated():
    turning = channel_of(unit="counts", counts_per_turn=8192)
    assert (turning.channel.quantity, turning.channel.unit) == ("angle", "rad")
    assert 4096 * turning.factor == pytest.approx(np.pi)
    sliding = channel_of(unit="counts/s", resolution_m=1e-6)
    assert (sliding.channel.quantity, sliding.channel.unit) == ("speed", "m/s")
    assert 5e5 * sliding.factor == pytest.approx(0.5)


def test_a_current_becomes_a_torque_where_its_constant_is_known():
    known = InputChannel("q", "i", "mA", torque_constant_nm_a=0.5, sign=-1)
    assert known.channel == Channel("q", "torque", "N m")
    assert 2000 * known.factor == pytest.approx(-1.0)
    unknown = InputChannel("q", "i", "mA", normalised=True)
    assert unknown.channel == Channel("q", "current", "A")
    assert 2000 * unknown.factor == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("kind", "unit", "quantity"),
    [
        (InputChannel, "N m", "torque"),
        (InputChannel, "kN", "force"),
        (InputChannel, "m/s", "speed_reference"),
        (InputChannel, "deg", "position_command"),
        (ReferenceChannel, "rpm", "speed_reference"),
        (ReferenceChannel, "mm", "position_command"),
        (OutputChannel, "deg", "angle"),
        (OutputChannel, "mm", "position"),
        (OutputChannel, "rpm", "speed"),
        (OutputChannel, "m/s^2", "acceleration"),
    ],
)
def test_a_unit_says_the_quantity_where_none_is_stated(kind, unit, quantity):
    assert kind("q", "x", unit).channel.quantity == quantity


def test_the_side_is_that_of_the_name_unless_stated():
    assert OutputChannel("q", "x").channel.side == "motor"
    assert OutputChannel("q.arm", "x").channel.side == "arm"
    assert OutputChannel("X", "x", "mm", side="tool").channel.side == "tool"


@pytest.mark.parametrize(
    ("channel", "told"),
    [
        (channel_of(unit="kA"), "S361 unknown unit `kA`"),
        (channel_of(unit="counts"), "S362"),
        (channel_of(unit="counts", counts_per_turn=1, resolution_m=1), "S362"),
        (channel_of(unit="deg", counts_per_turn=8192), "`counts_per_turn` belongs to `unit: counts`, not to deg"),
        (channel_of(unit="deg", quantity="torque"), "deg is no unit of a torque: use N m or mN m or kN m"),
        (channel_of(unit="rad", sign=2), "sign 2 is neither 1 nor -1"),
        (InputChannel("q", "i", "mA"), "S370"),
        (InputChannel("q", "u", "deg", torque_constant_nm_a=1.0), "S368"),
    ],
)
def test_what_contradicts_itself_is_told(channel, told):
    assert [problem for problem in channel.problems() if told in problem]


def test_inputs_of_one_log_must_go_together():
    torque, ratio = InputChannel("a", "u"), InputChannel("b", "i", "A", normalised=True)
    command = InputChannel("c", "r", "m/s")
    (mixed,) = input_problems((torque, command))
    assert "a is in N m (torque), c is in m/s (speed reference)" in mixed
    stated = tuple(replace(one, quantity=one.channel.quantity) for one in (torque, command))
    assert input_problems(stated) == []
    (mixed,) = input_problems((torque, InputChannel("d", "a", "mm/s^2")))
    assert "d is in m/s^2 (acceleration)" in mixed
    assert input_problems((torque, InputChannel("e", "f", "N"))) == []
    assert input_problems((InputChannel("X", "x", "mm"), InputChannel("A", "a", "deg"))) == []
    assert [one[:4] for one in input_problems((torque, ratio))] == ["S371"]
    assert [one[:4] for one in input_problems((torque, InputChannel("b", "u", hold="band_limited")))] == ["S372"]


def test_every_unit_may_be_written_and_every_quantity_has_one():
    assert {*get_args(UnitName)} == {*UNITS, "counts", "counts/s"}
    assert {*get_args(QuantityName)} == {*QUANTITIES}
    si = {unit.si for unit in UNITS.values()}
    assert all({*quantity.units} <= si for quantity in QUANTITIES.values())


def test_a_motion_has_an_acceleration_in_the_unit_of_its_kind():
    assert Channel("q", "angle", "rad", "arm").acceleration == Channel("q", "acceleration", "rad/s^2", "arm")
    assert Channel("x", "speed", "m/s", "tool").acceleration == Channel("x", "acceleration", "m/s^2", "tool")
    torque = Channel("q", "torque", "N m")
    assert torque.acceleration is torque


def test_who_wants_what():
    torques, angles = motor_channels("ab", "torque"), motor_channels("ab", "angle")
    assert MOTOR_TORQUE.accepts(torques)
    assert MOTOR_TORQUE.accepts(motor_channels("ab", "current"))
    assert not MOTOR_TORQUE.accepts((*torques, Channel("c", "torque", "N m", "arm")))
    assert not ACCELERATION.accepts(angles)
    assert ACCELERATION.accepts(one.acceleration for one in angles)
    assert str(MOTOR_TORQUE) == "motor torque or current"
    assert str(UsableChannels(("position_command",))) == "position command"
    assert describe((*angles, Channel("X", "position", "m", "tool"))) == "motor angle (a, b), tool position (X)"


@pytest.mark.parametrize(
    ("output", "inputs", "unit"),
    [("rad/s^2", "N m", "rad/(s^2 N m)"), ("rad/s^2", "A", "rad/(s^2 A)"), ("m", "m", "m/m"), ("m", "m/s", "m/(m/s)")],
)
def test_the_unit_of_a_response(output, inputs, unit):
    assert response_unit(output, inputs) == unit


@pytest.mark.parametrize(
    ("unit", "sampled", "rate"),
    [
        ("rad", "instants", 0),
        ("rpm", "instants", 1),
        ("rpm", "difference", 0),
        ("mm/s", "central_difference", 0),
        ("m/s^2", "instants", 2),
        ("m/s^2", "filtered", None),
        ("deg", "filtered", None),
    ],
)
def test_how_often_a_motion_is_differentiated_before_it_is_sampled(unit, sampled, rate):
    channel = OutputChannel("axis", "v", unit, sampled=sampled)
    assert channel.problems() == []
    assert channel.channel.rate == rate


@pytest.mark.parametrize("unit", ["rad", "deg/s^2", "N m"])
def test_only_speeds_are_differences(unit):
    (problem,) = OutputChannel("axis", "v", unit, sampled="difference").problems()
    assert "S374 `sampled: difference` belongs to a speed" in problem


@pytest.mark.parametrize("sampled", ["difference", "central_difference"])
def test_differences_of_a_position_become_its_acceleration(sampled):
    period_s, omega = 0.01, 2 * np.pi * np.array([1.0, 12.0, 40.0])
    z = np.exp(1j * omega * period_s)
    difference = (1 - 1 / z) / period_s if sampled == "difference" else (z - 1 / z) / (2 * period_s)
    found = Channel("axis", "speed", "rad/s", "motor", sampled).to_acceleration(omega, period_s)
    np.testing.assert_allclose(difference * found, -(omega**2), rtol=IDENTITY)

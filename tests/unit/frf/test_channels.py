"""Responses of any quantities: what outputs become, and what is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.channels import require
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.friction import TorqueLaw
from robid.signals.quantities import ACCELERATION, MOTOR_TORQUE, Channel, motor_channels
from robid.signals.record import Record
from tolerances import IDENTITY

N_SAMPLE, STEP_S, LINES = 256, 1e-2, np.array([3, 5, 9, 14])
OMEGA = 2 * np.pi * LINES / (N_SAMPLE * STEP_S)
PLAIN = EstimateOptions(compensation="none")


def played(inputs, outputs):
    """A steady state whose angle is 2/(1 + jw) of the input; its speed and acceleration are recorded beside it."""
    generator = np.random.default_rng(1)
    amplitude = np.exp(2j * np.pi * generator.uniform(size=LINES.size))
    angle = 2 / (1 + 1j * OMEGA) * amplitude
    wave = np.exp(1j * np.outer(np.arange(N_SAMPLE) * STEP_S, OMEGA))
    signals = [(wave @ one).real for one in (amplitude, angle, 1j * OMEGA * angle, -(OMEGA**2) * angle)]
    shape = (1, 1, 1, 2, N_SAMPLE, -1)
    held = np.broadcast_to(np.stack(signals, axis=-1), (2, N_SAMPLE, 4)).reshape(shape)
    return Record(
        sampling_period_s=STEP_S,
        inputs=held[..., :1],
        outputs=held[..., 1:],
        output_offset=np.zeros((1, 3)),
        input_channels=inputs,
        output_channels=outputs,
        configurations=np.zeros((1, 1)),
        excited_lines=LINES,
    )


MEASURED = (
    Channel("q", "angle", "rad"),
    Channel("q.tacho", "speed", "rad/s"),
    Channel("felt", "acceleration", "rad/s^2", "tool"),
)


def test_from_a_torque_every_motion_gives_the_same_acceleration():
    frf = estimate_frf(played(motor_channels("q", "torque"), MEASURED), PLAIN)
    exact = -(OMEGA**2) * 2 / (1 + 1j * OMEGA)
    np.testing.assert_allclose(frf.response[0, :, :, 0], np.repeat(exact[:, None], 3, axis=1), rtol=1e-9)
    assert {(one.quantity, one.unit) for one in frf.output_channels} == {("acceleration", "rad/s^2")}
    assert frf.measured_channels == MEASURED
    assert frf.unit == "rad/(s^2 N m)"


@pytest.mark.parametrize("estimator", ["logarithmic", "robust_local"])
def test_from_a_command_motions_stay_as_they_were_measured(estimator):
    command = (Channel("q", "position_command", "rad"),)
    frf = estimate_frf(played(command, MEASURED), replace(PLAIN, estimator=estimator))
    angle = 2 / (1 + 1j * OMEGA)
    exact = np.stack([angle, 1j * OMEGA * angle, -(OMEGA**2) * angle], axis=1)
    np.testing.assert_allclose(frf.response[0, :, :, 0], exact, rtol=1e-9)
    assert (frf.output_channels, frf.unit) == (MEASURED, "rad/rad")


def test_what_outputs_become_may_be_stated():
    torque, command = motor_channels("q", "torque"), motor_channels("q", "speed_reference")
    auto, measured = (estimate_frf(played(torque, MEASURED), replace(PLAIN, outputs=o)) for o in ("auto", "measured"))
    np.testing.assert_allclose(
        auto.response[..., 0, :], -(OMEGA[:, None] ** 2) * measured.response[..., 0, :], rtol=1e-9
    )
    stated = estimate_frf(played(command, MEASURED), replace(PLAIN, outputs="acceleration"))
    np.testing.assert_allclose(stated.response, auto.response, rtol=IDENTITY)
    assert ACCELERATION.accepts(stated.output_channels)


def test_friction_is_only_taken_from_motor_torques_along_their_angles():
    law, nominal = TorqueLaw(0.1, 0.1, 1.0, 0.01, 0.1, 0.0, 1), EstimateOptions(compensation="nominal")
    for inputs, outputs in (
        (motor_channels("q", "speed_reference"), MEASURED),
        (motor_channels("q", "torque"), (MEASURED[1], MEASURED[0], MEASURED[2])),
        (motor_channels("p", "torque"), MEASURED),
    ):
        with pytest.raises(DataError, match="friction is subtracted from motor torques") as caught:
            estimate_frf(played(inputs, outputs), nominal, (law,))
        assert "compensation: none" in caught.value.remedy
    estimate_frf(played(motor_channels("q", "torque"), MEASURED), nominal, (law,))


def test_one_shot_has_no_frequency_response():
    record = played(motor_channels("q", "torque"), MEASURED)
    shot = replace(record, excited_lines=np.zeros(0, int), configurations=None)
    assert shot.is_one_shot
    assert not record.is_one_shot
    with pytest.raises(DataError, match="no period and no excited lines"):
        estimate_frf(shot, PLAIN)
    with pytest.raises(DataError, match="no configuration that it rests in"):
        estimate_frf(replace(record, configurations=None), PLAIN)


def test_a_reader_says_what_it_wants_and_what_it_got():
    frf = estimate_frf(played(motor_channels("q", "speed_reference"), MEASURED), PLAIN)
    with pytest.raises(DataError) as caught:
        require(frf, MOTOR_TORQUE, ACCELERATION, "An elastic model")
    assert str(caught.value).startswith(
        "D014 An elastic model needs responses from motor torque or current to acceleration; this one is from motor"
        " speed reference (q) to motor angle (q), motor speed (q.tacho), tool acceleration (felt)"
    )
    command = played(motor_channels("q", "speed_reference"), MEASURED)
    with pytest.raises(DataError, match="from motor speed reference"):
        require(estimate_frf(command, replace(PLAIN, outputs="acceleration")), MOTOR_TORQUE, ACCELERATION, "It")
    require(estimate_frf(played(motor_channels("q", "current"), MEASURED), PLAIN), MOTOR_TORQUE, ACCELERATION, "It")

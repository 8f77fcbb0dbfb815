"""Logs of the joints' own angles and torques, read as the motors' and the other way around, on arms of other makers."""

from pathlib import Path

import numpy as np
import pytest

from answers import ask
from robid.models.known import load_experiment
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.judge.scales import motions_of, rigid_scale_findings
from robid.results.scale import Scale
from robid.signals.quantities import Channel
from robid.signals.record import Record

STEP_S, DURATION_S = 5e-3, 20.0
MODELS = ("mjcf_meshfree/panda_nohand.xml", "mjcf_meshfree/ur5e.xml", "urdf_meshfree/abb_irb120_3_58.urdf")


def rough(pin, model, rng):
    """The arm as it is in truth: masses off by a third and centres by centimetres."""
    model = model.copy()
    for body in range(1, model.njoints):
        own, factor = model.inertias[body], float(np.exp(0.35 * rng.normal()))
        centre = own.lever + 0.02 * rng.normal(size=3)
        model.inertias[body] = pin.Inertia(own.mass * factor, centre, own.inertia * factor)
    return model


def motion(pin, model, robot, rng):
    """Angles and torques (n_sample, n_joint) of its joints, with rotors and friction unlike the file."""
    count, time = len(robot.joints), np.arange(0, DURATION_S, STEP_S)
    lower, upper = np.maximum(robot.lower, -2.5), np.minimum(robot.upper, 2.5)
    omega = 0.2 * np.pi * np.arange(1, 6)
    phases = rng.uniform(0, 2 * np.pi, (count, 5, 1)) + omega[:, None] * time
    parts = rng.uniform(0.3, 1, (count, 5)) / np.arange(1, 6)
    parts *= 0.4 * ((upper - lower) / 2 / parts.sum(axis=1))[:, None]
    q, v, a = (
        np.einsum("jk,jkt->tj", parts * factor, wave(phases))
        for factor, wave in ((1, np.sin), (omega, np.cos), (-(omega**2), np.sin))
    )
    q += (lower + upper) / 2
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *one) for one in zip(q, v, a, strict=True)])
    size = np.abs(torque).max(axis=0) + 0.3
    rotor = np.array([joint.motor.inertia_kgm2 for joint in robot.joints]) * robot.gear_ratio**2
    torque += rng.uniform(0.3, 1.5, count) * rotor * a + 0.2 * size * (np.tanh(v / 0.01) + v)
    return q, torque + 0.01 * size * rng.normal(size=torque.shape)


@pytest.mark.parametrize("model", MODELS)
def test_the_other_side_of_the_gears_is_named_and_no_sound_log_accused(model, data_folder, tmp_path, monkeypatch):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    file = str((data_folder("robot_models") / model).absolute())
    monkeypatch.chdir(tmp_path)
    answer = ask("init", "arm", "--model", file)
    assert answer.code == 0, answer.err
    robot = load_experiment(Path("arm/arm.yaml")).robot.to_robot(0.0)
    build = pin.buildModelFromMJCF if model.endswith(".xml") else pin.buildModelFromUrdf
    rng = np.random.default_rng(4)
    q, torque = motion(pin, rough(pin, build(file), rng), robot, rng)
    ratio = robot.gear_ratio * np.exp(0.2 * rng.normal(size=len(robot.joints)))  # the file's are typical, not known

    def told(angle, torque, side):
        channels = [
            tuple(Channel(f"{joint.name}{end}", quantity, unit, side) for joint in robot.joints)
            for quantity, unit, end in (("torque", "N m", ""), ("angle", "rad", ".arm" if side == "arm" else ""))
        ]
        record = Record(
            inputs=torque[None, None, None, None],
            outputs=angle[None, None, None, None],
            output_offset=np.zeros((1, len(robot.joints))),
            configurations=None,
            sampling_period_s=STEP_S,
            excited_lines=np.zeros(0, int),
            input_channels=channels[0],
            output_channels=channels[1],
        )
        options = RigidFitOptions(instruments="none")
        found = rigid_scale_findings(robot, shots_of(record, robot), motions_of(record, robot), options)
        return [scale for finding in found for scale in finding.scales]

    assert told(q, torque, "arm") == told(q * ratio, torque / ratio, "motor") == []
    for side, angle, drive in (("motor", q, torque), ("arm", q * ratio, torque / ratio)):
        small = side == "arm"
        expected = [Scale("torque", "gear_ratio", small), Scale(f"{side}_angle", "gear_ratio", not small)]
        assert told(angle, drive, side) == expected
    assert told(q * ratio, torque, "motor") == [Scale("torque", "gear_ratio")]

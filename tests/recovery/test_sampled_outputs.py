"""The same springs from a motor's angle, speed or acceleration, at several sampling rates and bands."""

import numpy as np
import pytest

from exact_sampling import exact_acceleration
from exact_systems import linear_axis, two_joint_robot, two_mass_robot, with_spring_factors
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.signals.quantities import Channel, motor_channels
from robid.signals.record import Record
from tolerances import RECOVERY

ROBOTS = {
    "two masses": (two_mass_robot(stiffness=700.0, damping=0.05), np.zeros((1, 1))),
    "light arm": (two_joint_robot(), np.array([[-0.3, 0.5]])),
    "slide": (linear_axis(), np.array([[0.7]])),
}
KINDS = {
    "angle": ("angle", "rad", "instants"),
    "speed": ("speed", "rad/s", "instants"),
    "difference": ("speed", "rad/s", "difference"),
    "central": ("speed", "rad/s", "central_difference"),
    "acceleration": ("acceleration", "rad/s^2", "instants"),
}


def record_of(robot, configuration, kind, period_s, share, delay_s):
    """One block of periodic experiments without noise, lines up to a share of the sampling rate."""
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configuration))
    n_motor, n_sample = linear.n_motor, round(2.0 / period_s)
    lines = np.unique(np.geomspace(4, share * n_sample, 60).astype(int))
    omega = 2 * np.pi * lines / (n_sample * period_s)
    quantity, unit, sampled = KINDS[kind]
    rate = {"acceleration": 2, "speed": 1, "angle": 0}[quantity if sampled == "instants" else "angle"]
    parameters = nominal_parameters(robot, linear, delay_s)
    response = exact_acceleration(linear, parameters, omega / (2 * np.pi), period_s, rate)
    z = np.exp(1j * omega * period_s)
    back = {
        "instants": (1j * omega) ** (2 - rate),
        "difference": -(omega**2) * period_s / (1 - 1 / z),
        "central_difference": -(omega**2) * 2 * period_s / (z - 1 / z),
    }[sampled]
    generator = np.random.default_rng(5)
    torque = np.exp(2j * np.pi * generator.uniform(size=(len(lines), n_motor, n_motor)))
    torque += 3 * torque * np.eye(n_motor)
    spectra = torque, response @ torque / back[:, None, None]
    samples = []
    for each in spectra:
        whole = np.zeros((n_sample // 2 + 1, *each.shape[1:]), complex)
        whole[lines] = each
        samples.append(np.moveaxis(np.fft.irfft(whole, n_sample, axis=0), 2, 0)[None, None, :, None].repeat(2, 3))
    noise = generator.normal(size=samples[1].shape)
    samples[1] += 3e-7 * samples[1].std(axis=(3, 4), keepdims=True) * noise
    names = [joint.name for joint in robot.joints]
    return Record(
        sampling_period_s=period_s,
        inputs=samples[0],
        outputs=samples[1],
        output_offset=np.zeros((1, n_motor)),
        input_channels=motor_channels(names, "torque"),
        output_channels=tuple(Channel(name, quantity, unit, "motor", sampled) for name in names),
        configurations=configuration,
        excited_lines=lines,
        joint_units=tuple("m" if slides else "rad" for slides in robot.prismatic),
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("name", "period_s", "share", "delay_samples"),
    [
        ("two masses", 1e-3, 0.1, 0.3),
        ("two masses", 2e-3, 0.25, 1.6),
        ("slide", 2e-3, 0.25, 1.6),
        ("light arm", 1e-3, 0.1, 0.3),
    ],
)
def test_truth_returns(name, kind, period_s, share, delay_samples):
    robot, configuration = ROBOTS[name]
    n = len(robot.springs)
    truth = with_spring_factors(robot, np.full(n, 1.3), np.full(n, 0.7))
    delay_s = delay_samples * period_s
    record = record_of(truth, configuration, kind, period_s, share, delay_s)
    frf = estimate_frf(record, EstimateOptions(compensation="none"), None, delay_s)
    options = ElasticOptions(free=("stiffness", "damping", "delay"), weights=Weights("user"))
    found = fit_elastic(robot, frf, options, 0.5 * delay_s).estimate.found
    # Positions have their aliases to 1e-5 at a tenth of the sampling rate, to some 1e-4 at a quarter.
    tolerance = RECOVERY * (1 if kind in ("speed", "acceleration") else 10)
    for spring in truth.springs:
        assert found[f"{spring.name}.stiffness"] == pytest.approx(spring.stiffness, rel=tolerance)
    assert found["delay"] == pytest.approx(delay_s, abs=10 * tolerance * period_s)

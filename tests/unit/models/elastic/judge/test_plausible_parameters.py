"""Parameters that no robot can have are named; those of a sound fit are not."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.plausible_parameters import parameter_findings

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 25)
CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2]])
STEP = 1e-3
BAND_HZ = 2.0, 60.0
FREE = ("stiffness", "damping", "viscous", "motor_inertia", "link_inertia", "delay")


@pytest.fixture(scope="module")
def sound():
    """A fit of everything to a noisy response of a robot whose springs and dampers are off."""
    robot = two_joint_robot()
    true = with_spring_factors(robot, 1.5, 0.6)
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, delay_s=STEP, relative_noise=0.01)
    return fit_elastic(robot, frf, ElasticOptions(free=FREE), STEP).estimate


def changed(estimated, name, estimate, half_width):
    """The fit with another estimate and interval of one parameter."""
    index = estimated.names.index(name)
    values = {"value": estimate, "lower": estimate - half_width, "upper": estimate + half_width}
    moved = {key: np.where(np.arange(len(estimated.names)) == index, value, getattr(estimated, key))
             for key, value in values.items()}  # fmt: skip
    return replace(estimated, **moved)


def with_parameter(estimated, name, estimate, half_width):
    """The fit with a friction coefficient that it did not have."""
    values = {"value": estimate, "lower": estimate - half_width, "upper": estimate + half_width, "nominal": 0.0}
    values |= {"prior_relative_std": np.inf}
    grown = {key: np.append(getattr(estimated, key), value) for key, value in values.items()}
    return replace(estimated, names=(*estimated.names, name), kinds=(*estimated.kinds, "friction"), **grown)


def findings(estimated):
    return [
        (finding.cause, finding.decisive) for finding in parameter_findings(two_joint_robot(), estimated, BAND_HZ, STEP)
    ]


def test_a_sound_fit_gives_no_finding(sound):
    assert findings(sound) == []


def test_zero_inside_the_interval_is_no_finding(sound):
    assert findings(changed(sound, "elbow.viscous", -1e-3, 2e-3)) == []
    assert findings(changed(sound, "delay", -1e-3, 2e-3)) == []
    assert findings(with_parameter(sound, "elbow.level", -1.1, 0.3)) == []


def test_negative_friction(sound):
    assert findings(changed(sound, "elbow.viscous", -1e-3, 2e-4)) == [("friction", False)]
    told = parameter_findings(two_joint_robot(), changed(sound, "elbow.viscous", -1e-3, 2e-4), BAND_HZ, STEP)[0].message
    assert "try `arm_viscous` in `free`" in told
    freed = with_parameter(sound, "elbow.arm_viscous", 3.0, 0.3)
    told = parameter_findings(two_joint_robot(), changed(freed, "elbow.viscous", -1e-3, 2e-4), BAND_HZ, STEP)[0].message
    assert "arm_viscous" not in told
    assert findings(with_parameter(sound, "elbow.level", -1.5, 0.3)) == [("friction", True)]
    assert findings(with_parameter(sound, "elbow.torque_scale", -1.9, 0.3)) == [("torque_sign", True)]


def test_delays_of_a_few_samples_more_or_less_than_none(sound):
    assert findings(changed(sound, "delay", 3e-3, 1e-4)) == []  # three samples where one is declared
    assert findings(changed(sound, "delay", 6e-3, 1e-4)) == [("delay", False)]
    assert findings(changed(sound, "delay", 23e-3, 1e-4)) == [("delay", True)]  # more than half a turn at 60 Hz
    assert findings(changed(sound, "delay", -0.5e-3, 1e-4)) == [("delay", False)]
    assert findings(changed(sound, "delay", -3e-3, 1e-4)) == [("delay", True)]


def test_a_delay_that_is_in_the_data_is_found():
    robot = two_joint_robot()
    frf = exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, delay_s=6 * STEP, relative_noise=0.01)
    options = ElasticOptions(free=("stiffness", "damping", "delay"))
    found = parameter_findings(robot, fit_elastic(robot, frf, options, STEP).estimate, BAND_HZ, STEP)
    assert [finding.cause for finding in found] == ["delay"]
    assert "6 samples where 1 are declared" in found[0].message


def test_rotor_inertias(sound):
    stated = two_joint_robot().joints[0].motor.inertia_kgm2
    name = "shoulder.motor_inertia"
    assert findings(changed(sound, name, 1.1 * stated, 0.01 * stated)) == []  # two deviations of 5 %
    assert findings(changed(sound, name, 1.25 * stated, 0.15 * stated)) == []
    assert findings(changed(sound, name, 1.2 * stated, 0.01 * stated)) == [("rotor_inertia", False)]
    assert findings(changed(sound, name, 1.6 * stated, 0.1 * stated)) == [("rotor_inertia", False)]
    assert findings(changed(sound, name, 1e-7, 1e-5)) == [("rotor_inertia", True)]  # gone, whatever its interval says


def test_friction_far_from_what_was_known_is_of_another_kind(sound):
    names = (*sound.names, "elbow.lag", "elbow.torque_scale")
    for lag, scale, wanted in ((1.4, 0.02, []), (1.6, 0.02, ["friction"]), (0.0, -0.07, ["torque_constant"])):
        found = replace(
            sound,
            names=names,
            kinds=(*sound.kinds, "friction", "friction"),
            nominal=np.append(sound.nominal, [0.0, 0.0]),
            value=np.append(sound.value, [lag, scale]),
            lower=np.append(sound.lower, [lag - 0.1, scale - 0.01]),
            upper=np.append(sound.upper, [lag + 0.1, scale + 0.01]),
            prior_relative_std=np.append(sound.prior_relative_std, [0.5, 0.02]),
        )
        assert [finding.cause for finding in parameter_findings(two_joint_robot(), found, BAND_HZ, STEP)] == wanted


def test_link_inertias_that_no_body_has(sound):
    # The shoulder's other inertias are 0.2 and 1.4 kg m^2: a body's third lies between 1.2 and 1.6.
    stated = sound.stated["shoulder.link_inertia"]
    assert findings(changed(sound, "shoulder.link_inertia", stated + 0.05, 0.01)) == []
    assert findings(changed(sound, "shoulder.link_inertia", stated + 4.0, 0.1)) == [("masses", False)]
    assert findings(changed(sound, "shoulder.link_inertia", 1e-7, 1e-6)) == [("masses", True)]


def test_springs_that_ran_away(sound):
    stated = sound.stated["gear_1.stiffness"]
    assert findings(changed(sound, "gear_1.stiffness", 5 * stated, stated)) == []
    assert findings(changed(sound, "gear_1.stiffness", 30 * stated, 1e3 * stated)) == [("model", False)]
    assert findings(changed(sound, "gear_1.stiffness", 1e-3 * stated, stated)) == [("model", True)]
    far = changed(sound, "gear_1.stiffness", 30 * stated, 1e3 * stated)
    assert parameter_findings(two_joint_robot(), far, BAND_HZ, STEP, prior_decades=2.0) == ()


def test_decisive_doubts_come_first(sound):
    both = changed(changed(sound, "delay", 6e-3, 1e-4), "shoulder.motor_inertia", 1e-7, 1e-8)
    assert findings(both) == [("rotor_inertia", True), ("delay", False)]


def test_half_a_sample_early_is_a_difference_that_is_none(sound):
    early = changed(sound, "delay", -0.5 * STEP, 1e-2 * STEP)
    assert findings(early) == [("delay", False)]
    found = parameter_findings(two_joint_robot(), early, BAND_HZ, STEP, differenced=True)
    assert [(finding.cause, finding.decisive) for finding in found] == [("samples", False)]
    other = changed(sound, "delay", -0.8 * STEP, 1e-2 * STEP)
    assert parameter_findings(two_joint_robot(), other, BAND_HZ, STEP, differenced=True)[0].cause == "delay"

"""Viscous friction of arms comes back from responses, is told from the motors', and its lack is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot, with_arm_friction, with_spring_factors
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.robot.linearize import axial_inertia
from robid.robot.model import build_model
from robid.robot.parameters import viscous_scale
from robid.settings.load import load_robot
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, SimulateOptions
from tolerances import RECOVERY, RECOVERY_SIGMA

KR300 = Path(__file__).parents[2] / "configs/robots/kr300.yaml"
BENCH_HZ = np.arange(11.0, 251.0, 3.0)
BENCH = {"sampling_period_s": 4e-4, "delay_s": 5e-4, "torque_hold": "band_limited"}
BOTH = ("drive", "drive.arm")
BEFORE = ("stiffness", "damping", "viscous", "motor_inertia", "link_inertia", "delay")
FREE = (*BEFORE, "arm_viscous")
WIDE = ElasticOptions(free=FREE, prior_decades=1e6)
RUBS, VISCOUS = 0.08, 0.06


def bench():
    return with_arm_friction(two_mass_robot(viscous=VISCOUS, rotor_std=2.3), RUBS)


@pytest.mark.parametrize("outputs", [BOTH, ("drive",)], ids=["both encoders", "the motor alone"])
def test_two_inertias_without_noise(outputs):
    frf = exact_frf(bench(), [[0.0]], BENCH_HZ, **BENCH, output_names=outputs, declared_noise=1e-6)
    nominal = with_spring_factors(two_mass_robot(rotor_std=1e6), 0.7, 3.0)
    found = fit_elastic(nominal, frf, WIDE, 4e-4).estimate.found
    assert found["drive.arm_viscous"] == pytest.approx(RUBS, rel=RECOVERY)
    assert found["drive.viscous"] == pytest.approx(VISCOUS, rel=RECOVERY)
    assert found["coupling.damping"] == pytest.approx(0.01, rel=RECOVERY)


def test_its_lack_goes_into_the_dampers_and_is_named():
    frf = exact_frf(bench(), [[0.0]], BENCH_HZ, **BENCH, output_names=BOTH, relative_noise=1e-3)
    nominal, options = two_mass_robot(rotor_std=2.3), replace(WIDE, free=BEFORE)
    solution = fit_elastic(nominal, frf, options, 5e-4)
    assert solution.estimate.found["coupling.damping"] > 3 * 0.01
    fitted = fitted_model(nominal, solution, frf, options, 5e-4)
    first = explain(fitted)[0]
    assert first.cause == "arm_friction"
    assert first.share > 0.3
    # What is explained of an arm is the estimate that freeing it gives, to first order.
    assert first.amounts[0] == pytest.approx(RUBS, rel=0.3)
    assert "which `arm_viscous` in `free` estimates" in assess_fit(nominal, solution, frf, options, 5e-4).sentence
    solution = fit_elastic(nominal, frf, WIDE, 5e-4)
    fitted = fitted_model(nominal, solution, frf, WIDE, 5e-4)
    assert "arm_friction" not in {each.cause for each in explain(fitted)}


def test_a_motor_alone_at_low_frequencies_does_not_tell_them_apart():
    """Below the antiresonance arm and motor move as one, and a fit says that only a combination is known."""
    frf = exact_frf(bench(), [[0.0]], np.arange(1.0, 12.0, 0.5), **BENCH, relative_noise=1e-3)
    options = replace(WIDE, free=("stiffness", "damping", "viscous", "arm_viscous", "delay"), prior_decades=1.0)
    estimate = fit_elastic(bench(), frf, options, 5e-4).estimate
    told = dict(zip(estimate.names, estimate.identifiable.tolist(), strict=True))
    assert not told["drive.arm_viscous"]
    combined = [names for names in map(str, estimate.undetermined) if "arm_viscous" in names]
    assert combined


def test_a_simulated_drive_gives_it_back():
    """In the time domain: the closed loop of MuJoCo, then the response, then the fit."""
    ratio = 100.0
    robot = two_mass_robot(5e-3, 40.0, 5e4, 25.0, ratio, 4e-3)
    robot, controller = with_arm_friction(robot, 90.0), Controller()
    lines = np.arange(3, 240, 4)
    amplitude = np.full((1, lines.size), 20.0 * np.sqrt(2 / lines.size))
    phase = np.random.default_rng(5).uniform(0, 2 * np.pi, (1, 1, lines.size))
    run = SimulatedExperiment(
        robot=robot,
        controller=controller,
        options=SimulateOptions(transient_periods=1),
        reference=time_signal(multisine(amplitude, phase), lines, round(4.0 / controller.sampling_period_s)),
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        periods=1,
    )
    frf = estimate_frf(simulate(run, np.zeros(1), 0), EstimateOptions(compensation="none"))
    options = ElasticOptions(free=("stiffness", "damping", "viscous", "arm_viscous", "delay"), weights=Weights("user"))
    delay_s = controller.delay_samples * controller.sampling_period_s
    found = fit_elastic(with_arm_friction(robot, 0.0), frf, options, delay_s).estimate.found
    assert found["drive.arm_viscous"] == pytest.approx(90.0, rel=0.02)
    assert found["drive.viscous"] == pytest.approx(4e-3, rel=0.05)
    assert found["coupling.damping"] == pytest.approx(25.0, rel=0.02)


def test_the_kr300_from_its_motors_alone():
    nominal = load_robot(KR300).to_robot()
    rubs = 0.5 * viscous_scale(axial_inertia(build_model(nominal)))
    robot = with_arm_friction(with_spring_factors(nominal, 1.2, 0.8), *rubs)
    places = np.deg2rad([[10, -80, 60, 20, 40, -30], [-60, -40, 10, 70, -50, 20], [90, -110, 100, -40, 80, 60]])
    frf = exact_frf(robot, places, np.geomspace(3.0, 60.0, 60), delay_s=1e-3, relative_noise=2e-3)
    options = ElasticOptions(
        free=("stiffness", "damping", "viscous", "arm_viscous", "delay"), weights=Weights("optimal")
    )
    solution = fit_elastic(nominal, frf, options, 1e-3)
    estimate = solution.estimate
    chosen = np.array(estimate.kinds) == "arm_viscous"
    assert chosen.sum() == 6
    off = estimate.value[chosen] - rubs
    deviation = np.sqrt(np.diag(solution.estimate.covariance))[chosen]
    assert (np.abs(off) <= RECOVERY_SIGMA * deviation).all()
    told = estimate.identifiable[chosen]
    assert told.sum() >= 3, "the first axes' links are heavy enough to show it"

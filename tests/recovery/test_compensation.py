"""Friction compensation on the simulated KR300: what it leaves of the bias, and the coefficients it finds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.excitation.excitation import design_excitation
from robid.frf.estimate import estimate_frf
from robid.frf.laws import combine_laws
from robid.frf.options import EstimateOptions
from robid.frf.silent import identify_laws, start_laws
from robid.models.files import load_experiment
from robid.pipeline.estimate_frf import stated_law
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Imperfections
from robid.simulate.truth import true_robot

pytestmark = pytest.mark.slow

LOADED = load_experiment(Path(__file__).parents[2] / "configs/kr300.yaml")
CAMPAIGN = LOADED.experiment.campaigns["estimation"]
CONTROLLER = LOADED.robot.controller
NOMINAL = LOADED.robot.to_robot(CAMPAIGN.payload_kg)
TRUTH = true_robot(NOMINAL, CAMPAIGN.source.simulate.truth)
DELAY_S = CONTROLLER.delay_samples * CONTROLLER.sampling_period_s
CONFIGURATIONS = np.deg2rad([[20.0, -60.0, 60.0, 40.0, 50.0, 10.0], [-50.0, -95.0, 20.0, -70.0, -60.0, 120.0]])
NAMES = tuple(joint.name for joint in NOMINAL.joints)
STATED = tuple(stated_law(joint.motor) for joint in NOMINAL.joints)
EXACT = tuple(stated_law(joint.motor) for joint in TRUTH.joints)
# Nothing of the robot file's friction: all that is known is the order of the ripple.
BLIND = tuple(replace(law, coulomb_nm=0.0, static_nm=0.0) for law in STATED)


def record(configuration, index, **changes):
    simulated = replace(CAMPAIGN.source.simulate, **changes)
    excitation = design_excitation(CAMPAIGN.excitation, len(NAMES), 2, CONTROLLER.sampling_period_s)
    run = SimulatedExperiment(
        robot=TRUTH,
        controller=CONTROLLER,
        options=simulated,
        reference=excitation.reference,
        inject=excitation.kind,
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=2,
    )
    return simulate(run, configuration, index)


def bias(measured, laws):
    """Median over the lines of the diagonal's relative error against the robot without friction, in per cent."""
    model = build_model(TRUTH)
    linear = linearize(model, solve_statics(model, measured.configurations))
    held_s = CONTROLLER.sampling_period_s
    exact = response(linear, nominal_parameters(TRUTH, linear, DELAY_S), measured.frequency_hz, held_s).sampled
    options = EstimateOptions(compensation="none" if laws is None else "silent_lines")
    found = estimate_frf(measured, options, laws, DELAY_S).response
    return 100 * float(np.median(np.abs(np.diagonal(found / exact - 1, axis1=2, axis2=3))))


def identify(records, stated, oversampling=2):
    start = start_laws(records[0], stated, DELAY_S)
    found = [identify_laws(one, start, DELAY_S, oversampling) for one in records]
    return combine_laws(found, start, stated, NAMES)[0]


def test_law_of_the_family_comes_back():
    # The engine moves bristles once per step: eight steps per sample make its law the one that is integrated here.
    flaws = Imperfections(friction="lugre")
    records = [record(CONFIGURATIONS[0], 0, imperfections=flaws, steps_per_sample=8)]
    laws = identify(records, BLIND, oversampling=8)
    for law, exact in zip(laws, EXACT, strict=True):
        np.testing.assert_allclose(law.values[:4], exact.values[:4], rtol=0.03)
    left = bias(records[0], laws)
    print(f"\nfriction of the family: median bias {left:.4f} %, {bias(records[0], None):.2f} % without compensation")
    assert left < 0.5


@pytest.mark.parametrize("stated", [BLIND, STATED], ids=["blind", "from the file"])
def test_lugre_inside_the_integrator_with_all_imperfections(stated):
    records = [record(configuration, index) for index, configuration in enumerate(CONFIGURATIONS)]
    laws = identify(records, stated)
    for index, one in enumerate(records):
        plain, nominal, left = bias(one, None), bias(one, STATED), bias(one, laws)
        print(f"\nconfiguration {index}: {plain:.2f} % without, {nominal:.2f} % nominal, {left:.3f} % silent lines")
        assert left < 1.5
        assert left < 0.5 * nominal
    for law, exact in zip(laws, EXACT, strict=True):
        np.testing.assert_allclose(law.values[0], exact.values[0], rtol=0.03)
        np.testing.assert_allclose(law.values[3], exact.values[3], rtol=0.03)

"""Local models on the simulated KR300: how few experiments are enough, and records that begin with a transient."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.excitation.excitation import design_excitation
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.known import load_experiment
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Imperfections, SimulateOptions

LOADED = load_experiment(Path(__file__).parents[2] / "configs/kr300.yaml")
CAMPAIGN = LOADED.experiment.campaigns["estimation"]
ROBOT, CONTROLLER = LOADED.robot.to_robot(CAMPAIGN.payload_kg), LOADED.robot.controller
CONFIGURATION = np.deg2rad([[10.0, -60.0, 70.0, 30.0, 40.0, 20.0]])
SENSORS = Imperfections(encoder_noise_rad=1e-5, encoder_resolution_rad=9.6e-5, torque_noise_nm=0.05)
FLAWS = {"exact": Imperfections(), "noise": SENSORS, "everything": CAMPAIGN.source.simulate.imperfections}
LOGARITHMIC = EstimateOptions(compensation="none")
MODELS = {"2/0": (2, 0), "2/2": (2, 2), "4/2": (4, 2)}

pytestmark = pytest.mark.slow


def kr300_record(flaws, *, transient_periods=1, realizations=4, seed=1, **excitation):
    """A record of the nominal robot in one configuration, and its exact response."""
    period_s = CONTROLLER.sampling_period_s
    changed = replace(CAMPAIGN.excitation, phase_iterations=0, seed=seed, **excitation)
    designed = design_excitation(changed, len(ROBOT.joints), realizations, period_s)
    experiment = SimulatedExperiment(
        robot=ROBOT,
        controller=CONTROLLER,
        options=SimulateOptions(imperfections=flaws, seed=seed, transient_periods=transient_periods),
        reference=designed.reference,
        inject=designed.kind,
        excited_lines=designed.excited_lines,
        detection_lines=designed.detection_lines,
        periods=2,
    )
    record = simulate(experiment, CONFIGURATION[0], 0)
    model = build_model(ROBOT)
    linear = linearize(model, solve_statics(model, CONFIGURATION))
    nominal = nominal_parameters(ROBOT, linear, CONTROLLER.delay_samples * period_s)
    return record, response(linear, nominal, record.frequency_hz, period_s).sampled[0]


def first_experiments(record, realizations, experiments):
    kept = np.s_[:, :realizations, :experiments]
    channels = ("inputs", "outputs", "reference")
    return replace(record, **{name: getattr(record, name)[kept] for name in channels})


def diagonal_error(record, exact, options):
    """Median relative error of the diagonal."""
    found = estimate_frf(record, options).response[0]
    return float(np.median(np.abs(np.diagonal(found / exact, axis1=1, axis2=2) - 1)))


@pytest.mark.parametrize("period_s", [5.0, 10.0])
@pytest.mark.parametrize("flaws", FLAWS)
def test_how_few_experiments_are_enough(flaws, period_s):
    dense = {"period_s": period_s, "count": int(39 * period_s), "spacing": "linear", "detection_share": 0.0}
    record, exact = kr300_record(FLAWS[flaws], **dense)
    ratios = {}
    for realizations in (1, 2, 4):
        full = diagonal_error(first_experiments(record, realizations, 6), exact, LOGARITHMIC)
        print(f"{flaws}, {period_s:g} s, {realizations} realizations: full block {full:.4%}")
        for experiments in (6, 5, 4, 3, 2, 1):
            part = first_experiments(record, realizations, experiments)
            for name, (order, denominator) in MODELS.items():
                options = replace(
                    LOGARITHMIC, estimator="local_periodic", local_order=order, local_denominator=denominator
                )
                ratios[realizations, experiments, name] = diagonal_error(part, exact, options) / full
            if realizations * experiments > 6:
                alone = replace(LOGARITHMIC, estimator="local_periodic", local_order=0, local_half_width_lines=0)
                ratios[realizations, experiments, "joint"] = diagonal_error(part, exact, alone) / full
            found = {key[2]: f"{value:.2f}" for key, value in ratios.items() if key[:2] == (realizations, experiments)}
            print(f"  {experiments} experiments: " + "  ".join(f"{key} {value}" for key, value in found.items()))
    if flaws != "exact":
        # What the setting's description promises.
        assert ratios[1, 3, "2/0"] < 1.5
        assert ratios[1, 2, "2/2"] < 1.5
        assert ratios[4, 1, "4/2"] < 1.5


@pytest.mark.parametrize("flaws", ["exact", "noise"])
def test_a_record_that_begins_with_a_transient(flaws):
    record, exact = kr300_record(FLAWS[flaws], transient_periods=0, realizations=2)
    plain = diagonal_error(record, exact, LOGARITHMIC)
    robust = diagonal_error(record, exact, replace(LOGARITHMIC, estimator="robust_local"))
    print(f"{flaws}: {plain:.4%} with the transient, {robust:.4%} without")
    assert robust < plain / 5

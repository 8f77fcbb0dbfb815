"""The estimation campaign of the default experiment, of any length, in one configuration."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from robid.design.excitation.lines import choose_lines
from robid.models.known import load_experiment
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment
from robid.simulate.truth import true_robot

LOADED = load_experiment(Path(__file__).parents[1] / "configs/kr300.yaml")
CAMPAIGN = LOADED.experiment.campaigns["estimation"]
ROBOT = LOADED.robot.to_robot(CAMPAIGN.payload_kg)
CONFIGURATION = np.deg2rad([10.0, -60.0, 70.0, 30.0, 40.0, 20.0])
DELAY_S = LOADED.robot.controller.delay_samples * LOADED.robot.controller.sampling_period_s


def default_experiment(period_s, periods):
    """The estimation campaign of the default experiment, of another length."""
    options = CAMPAIGN.source.simulate
    excitation = replace(CAMPAIGN.excitation, period_s=period_s, count=min(60, int(20 * period_s)))
    sampling_period_s = LOADED.robot.controller.sampling_period_s
    lines, detection = choose_lines(excitation, sampling_period_s)
    generator = np.random.default_rng(1)
    n_motor = len(ROBOT.joints)
    level = np.broadcast_to(excitation.rms, n_motor) * np.sqrt(2 / lines.size)
    phases = generator.uniform(0, 2 * np.pi, (CAMPAIGN.realizations, n_motor, lines.size))
    spectrum = multisine(np.tile(level[:, None], lines.size), phases)
    return SimulatedExperiment(
        robot=true_robot(ROBOT, options.truth),
        controller=LOADED.robot.controller,
        options=options,
        reference=time_signal(spectrum, lines, round(period_s / sampling_period_s)),
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=detection,
        periods=periods,
    )

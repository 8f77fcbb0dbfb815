"""A simulated experiment on a robot: what a campaign on the real one would tell."""

from __future__ import annotations

from collections.abc import Sequence

from robid.scaffold.robot_text import number
from robid.scaffold.sizes import Drive

_NOISE_SHARE = 5e-3

_TEXT = """\
# A simulated campaign on the robot of {name}_robot.yaml: which springs would be found, from where, and how well.
# Its springs are off the robot file by up to a factor of 2, and the fit has to find them.
schema_version: 2
name: {name} # results lie in runs/<name> of the folder in which robid is started
robot: {name}_robot.yaml

campaigns:
  candidates: # not measured: the configurations to choose from
    configurations: {{random: {{count: 40, seed: 1}}}}
    excitation: &excitation # what the controller adds to its speed reference: a sum of sines that repeats
      period_s: 4
      low_hz: 2 # the band must hold the first resonances
      high_hz: 80
      count: 60
      rms: 12 # rad/s of the motor, scaled until ...
      limit_share: 0.8 # ... this share of the nearest limit of torque, speed or excursion is reached
      seed: 1
  estimation: # what the model is fitted to
    configurations: {{from: optimal}}
    excitation: *excitation
    realizations: 2 # with other phases: what differs between them is due to nonlinearity, above all friction
    periods: 2 # of each: what differs between them is noise
    source:
      simulate: &simulate # with logs of the real robot: `acquire`; `robid inspect LOG --propose` writes it
        transient_periods: 1
        imperfections: {{encoder_noise_rad: 1.0e-5, encoder_resolution_rad: 9.6e-5, resolver_error_rad: 5.0e-4, \
torque_noise_nm: {noise}, ripple: true, friction: lugre}}
        truth: {{spring_factor: 2, friction_relative: 0.15, seed: 1}}
        seed: 1
  validation: # what the model is judged by: configurations that the fit never sees
    configurations: {{random: {{count: 2, seed: 2}}}}
    excitation: {{<<: *excitation, seed: 2}}
    realizations: 2
    periods: 2
    source: {{simulate: {{<<: *simulate, seed: 2}}}}

designs:
  optimal: {{campaign: candidates, count: 6}} # the 6 that tell most about the springs

fits:
  elastic: {{family: elastic, from: estimation, validate_on: validation, starts: 4}}

execution: {{backend: processes, workers: 2, log_level: info}} # how it is computed; changes no result
"""


def experiment_text(name: str, drives: Sequence[Drive]) -> str:
    """Writes the experiment file of a robot with these drives."""
    # Coulomb friction is a share of a motor's torque, so that the smallest tells what noise none of them drowns in.
    smallest = min(drive.coulomb_nm for drive in drives)
    return _TEXT.format(name=name, noise=number(float(f"{_NOISE_SHARE * 50 * smallest:.1g}")))

"""The default robot against its published figures and the issue's frame for its modes."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.information import design_configurations
from robid.design.excitation.excitation import design_excitation
from robid.models.known import load_experiment
from robid.pipeline.configurations import configurations_of
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model

CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.fixture(scope="module")
def loaded():
    return load_experiment(CONFIGS / "kr300.yaml")


def default_configurations(loaded):
    """Returns the configurations that the default experiment measures: those of its design, and the validation's."""
    robot, experiment = loaded.robot.to_robot(), loaded.experiment
    design = experiment.designs["optimal"]
    campaign = experiment.campaigns[design.campaign]
    candidates = configurations_of(loaded, campaign, {})
    period_s = loaded.robot.controller.sampling_period_s
    frequency_hz = design_excitation(campaign.excitation, 6, 1, period_s).frequency_hz
    matrices, names = candidate_information(robot, candidates, frequency_hz, period_s, period_s, 0.03)
    chosen = design_configurations(matrices, candidates, names, design.options()).chosen
    validation = configurations_of(loaded, experiment.campaigns["validation"], {})
    return robot, np.concatenate([candidates[chosen], validation])


def test_first_locked_motor_mode_lies_between_5_and_12_hz(loaded):
    robot, configurations = default_configurations(loaded)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    stiffness = np.diag([spring.stiffness for spring in robot.springs])
    links = np.einsum("l,clij->cij", linear.axial, linear.link_inertia)
    for mass, gravity in zip((linear.mass + links)[:, 6:, 6:], linear.gravity_stiffness[:, 6:, 6:], strict=True):
        lowest = np.sqrt(eigh(gravity + stiffness, mass, eigvals_only=True)[0]) / (2 * np.pi)
        assert 5 < lowest < 12


def test_model_has_the_published_masses_and_13_spring_damper_pairs(loaded):
    robot = loaded.robot.to_robot()
    published = 395.4 + 339.12 + 105.21 + 35.8 + 31.46 + 17.78
    assert sum(joint.link.mass_kg for joint in robot.joints) == pytest.approx(published)
    assert build_model(robot).mujoco.body_mass.sum() == pytest.approx(published + 150, abs=1e-4)
    places = [spring.place for spring in robot.springs]
    assert [places.count(place) for place in ("transmission", "bearing", "split")] == [6, 6, 1]
    assert robot.gear_ratio == pytest.approx([1798 / 7, 1872 / 7, 757 / 3, 221, 5032 / 21, 206793 / 1340])


def test_values_without_a_source_are_marked(loaded):
    assumed = loaded.robot.to_robot().assumed
    for spring in loaded.robot.springs:
        assert f"{spring.name}.damping_nms_rad" in assumed
        published = spring.name in ("gear_1", "gear_2", "gear_3")
        assert (f"{spring.name}.stiffness_nm_rad" in assumed) != published

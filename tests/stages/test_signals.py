"""Every kind of excitation goes through the chain, and what cannot be made is told by its field."""

import numpy as np
import pytest

from robid.artifacts.kinds import (
    DESIGN,
    EXCITATION,
    FRF,
    design_from_artifact,
    excitation_from_artifact,
    frf_from_artifact,
)
from robid.artifacts.store import read_artifact
from robid.design.configurations.candidates import candidate_information
from robid.models.known import load_experiment
from tolerances import IDENTITY

KIND = "excitation: {<<: *excitation, seed: 2}"
BAND = "period_s: 0.5, low_hz: 10, high_hz: 80, seed: 2, rms: 0.5, slow_motion_rad_s: 0.2"
LINEAR = "imperfections: {encoder_noise_rad: 1.0e-5, torque_noise_nm: 0.02, friction: lugre}"


def estimated(shop):
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = shop.robid(stage, "small.yaml", "--campaign", "validation", "--force")
        assert answer.code == 0, answer.err
    return frf_from_artifact(read_artifact(shop.runs / "validation" / "frf.h5", FRF))


@pytest.mark.parametrize(
    "fields",
    [
        "signal: chirp",
        "signal: stepped_sine, count: 4",
        "signal: fourier, at_rest: true, count: 14",
    ],
)
def test_every_kind_gives_the_response_that_a_multisine_gives(shop, fields):
    shop.change(LINEAR, "imperfections: {}")
    shop.change("compensation: nominal", "compensation: none")
    shop.change("compensation: nominal", "compensation: none")
    shop.change(KIND, KIND.replace("seed: 2", "seed: 2, rms: 0.5, grid: full, count: 35, detection_share: 0"))
    multisine = estimated(shop)
    shop.change("<<: *excitation, seed: 2, rms: 0.5, grid: full, count: 35, detection_share: 0", f"{BAND}, {fields}")
    other = estimated(shop)
    common, first, second = np.intersect1d(multisine.lines, other.lines, return_indices=True)
    assert len(common) >= 5
    wanted, found = multisine.response[0, first], other.response[0, second]
    error = np.abs(found - wanted).max(axis=(1, 2)) / np.abs(wanted).max(axis=(1, 2))
    assert np.median(error) < 2e-3


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ("slow_motion_rad_s: 5, slow_motion_line: 3", "line 3 is odd"),
        ("slow_motion_rad_s: 5, inject: torque", "needs a reference of speed or position"),
        ("chirp_peak: 0.5", "chirp_peak: S386 belongs to `signal: chirp` or `signal: pose_chirp`, not to"),
        ("signal: sweep", "'multisine', 'chirp', 'stepped_sine', 'fourier'"),
    ],
)
def test_what_cannot_be_made_is_told_on_its_line(shop, fields, words):
    shop.change(KIND, KIND.replace("seed: 2", f"seed: 2, {fields}"))
    answer = shop.robid("design-excitation", "small.yaml", "--campaign", "validation")
    assert answer.code == 2
    assert "small.yaml:22: campaigns.validation.excitation" in answer.flat
    assert words in answer.flat


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ("signal: stepped_sine, count: 14, grid: odd", "one cycle of each of 14 frequencies takes"),
        ("signal: chirp, chirp_peak: 1", "chirp_peak: S383 input should be less than 1"),
        ("signal: chirp, count: 14", "count: S386 belongs to `signal: multisine`"),
    ],
)
def test_what_another_signal_cannot_be_is_told_on_its_line(shop, fields, words):
    shop.change(KIND, f"excitation: {{period_s: 0.5, low_hz: 4, high_hz: 80, {fields}}}")
    answer = shop.robid("design-excitation", "small.yaml", "--campaign", "validation")
    assert answer.code == 2
    assert "small.yaml:22: campaigns.validation.excitation" in answer.flat
    assert words in answer.flat


@pytest.mark.parametrize(
    "fields", ["", "signal: chirp", "signal: stepped_sine, count: 4", "signal: fourier, count: 14"]
)
def test_a_design_is_made_for_the_lines_that_are_played(shop, fields):
    shop.change(KIND, f"excitation: {{{BAND}, {fields or 'count: 14'}}}")
    shop.change(
        "best: {campaign: candidates, between_relative_std: {stiffness: 0, damping: 0}, count: 2}",
        "best: {campaign: validation, count: 1}",
    )
    for arguments in (("design-configs",), ("design-excitation", "--campaign", "validation")):
        answer = shop.robid(arguments[0], "small.yaml", *arguments[1:])
        assert answer.code == 0, answer.err
    design = design_from_artifact(read_artifact(shop.runs / "designs/best.h5", DESIGN))
    played = excitation_from_artifact(read_artifact(shop.runs / "validation/excitation.h5", EXCITATION)).excitation
    loaded = load_experiment(shop.folder / "small.yaml")
    about, robot = loaded.experiment.designs["best"].about(), loaded.robot.to_robot()
    wanted, _ = candidate_information(
        robot,
        design.configurations,
        played.frequency_hz,
        played.sampling_period_s,
        loaded.robot.controller.delay_samples * played.sampling_period_s,
        about.assumed_relative_error,
        nuisance=("viscous", "motor_inertia", "delay"),
        weights=np.ones((len(played.excited_lines), 2, 2)),
    )
    np.testing.assert_allclose(design.information, wanted, rtol=IDENTITY)


def test_a_slow_motion_over_a_limit_is_refused(shop):
    shop.change(KIND, KIND.replace("seed: 2", "seed: 2, low_hz: 10, slow_motion_rad_s: 380"))
    answer = shop.robid("design-excitation", "small.yaml", "--campaign", "validation")
    assert answer.code == 2
    assert "configuration 1: speed peak" in answer.flat
    assert "exceeds 400 rad/s" in answer.flat

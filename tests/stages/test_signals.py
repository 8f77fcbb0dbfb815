"""Every kind of excitation goes through the chain, and what cannot be made is told by its field."""

import numpy as np
import pytest

from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact

KIND = "excitation: {<<: *excitation, seed: 2}"
LINEAR = "imperfections: {encoder_noise_rad: 1.0e-5, torque_noise_nm: 0.02, friction: lugre}"


def estimated(shop):
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = shop.robid(stage, "small.yaml", "--campaign", "validation", "--force")
        assert answer.code == 0, answer.err
    return frf_from_artifact(read_artifact(shop.runs / "validation" / "frf.h5", FRF))


@pytest.mark.parametrize(
    "fields",
    ["signal: chirp", "signal: stepped_sine, count: 4", "signal: fourier, at_rest: true"],
)
def test_every_kind_gives_the_response_that_a_multisine_gives(shop, fields):
    shop.change(LINEAR, "imperfections: {}")
    shop.change("compensation: nominal", "compensation: none")
    shop.change("compensation: nominal", "compensation: none")
    shop.change(KIND, KIND.replace("seed: 2", "seed: 2, rms: 0.5, grid: full, count: 35, detection_share: 0"))
    multisine = estimated(shop)
    shop.change(
        "rms: 0.5, grid: full, count: 35, detection_share: 0", f"rms: 0.5, low_hz: 10, slow_motion_rad_s: 0.2, {fields}"
    )
    other = estimated(shop)
    common, first, second = np.intersect1d(multisine.lines, other.lines, return_indices=True)
    assert len(common) >= 5
    wanted, found = multisine.response[0, first], other.response[0, second]
    error = np.abs(found - wanted).max(axis=(1, 2)) / np.abs(wanted).max(axis=(1, 2))
    assert np.median(error) < 2e-3


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ("signal: stepped_sine", "one cycle of each of 14 frequencies takes"),
        ("slow_motion_rad_s: 5, slow_motion_line: 3", "line 3 is odd"),
        ("slow_motion_rad_s: 5, inject: torque", "needs a reference of speed or position"),
        ("signal: chirp, chirp_peak: 1", "chirp_peak"),
        ("signal: sweep", "'multisine', 'chirp', 'stepped_sine' or 'fourier'"),
    ],
)
def test_what_cannot_be_made_is_told_on_its_line(shop, fields, words):
    shop.change(KIND, KIND.replace("seed: 2", f"seed: 2, {fields}"))
    answer = shop.robid("design-excitation", "small.yaml", "--campaign", "validation")
    assert answer.code == 2
    assert "small.yaml:22: campaigns.validation.excitation" in answer.flat
    assert words in answer.flat


def test_a_slow_motion_over_a_limit_is_refused(shop):
    shop.change(KIND, KIND.replace("seed: 2", "seed: 2, low_hz: 10, slow_motion_rad_s: 380"))
    answer = shop.robid("design-excitation", "small.yaml", "--campaign", "validation")
    assert answer.code == 2
    assert "configuration 1: speed peak" in answer.flat
    assert "exceeds 400 rad/s" in answer.flat

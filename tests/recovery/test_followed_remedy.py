"""A heavy and a light robot that carry more than their file says: the misfit falls as promised where it is followed."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf
from robid.fit.elastic.fitting import fit_elastic
from robid.fit.elastic.options import ElasticOptions
from robid.robot.description import Inertial
from robid.settings.load import load_robot
from robid.validation.elastic.causes import explain
from robid.validation.elastic.fitted import fitted_model

ROBOTS = Path(__file__).parents[2] / "configs" / "robots"
FREQUENCY_HZ = np.geomspace(2, 80, 25)
OPTIONS = ElasticOptions(strategy="plain")
DELAY_S = 1e-3


@pytest.mark.parametrize("name", ["kr300", "ur5e"])
def test_a_payload_that_is_off_by_a_thirtieth_is_named_and_found(name):
    if name == "ur5e" and not (Path(os.environ.get("ROBID_DATA", "../shared/data")) / "robot_models").is_dir():
        pytest.skip("shared/data/robot_models is absent")
    stated = load_robot(ROBOTS / f"{name}.yaml").to_robot()
    load = stated.payload
    heavier = Inertial(load.mass_kg * 31 / 30, load.com_m, load.inertia_kgm2 * 31 / 30)
    places = np.random.default_rng(3).uniform(-0.8, 0.8, (4, 6)) + np.array([0, -0.9, 0.9, 0, 0.6, 0])
    frf = exact_frf(replace(stated, payload=heavier), places, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=5e-4)
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first = explain(stated, fitted_model(stated, before, frf, OPTIONS, DELAY_S), OPTIONS)[0]
    assert (first.cause, first.free) == ("payload", ("payload",))
    near = dict(zip(before.estimate.names, before.internal.values.tolist(), strict=True))
    after = fit_elastic(stated, frf, replace(OPTIONS, free=first.free), DELAY_S, near=near)
    assert 1 - after.costs.total / before.costs.total > first.share - 0.05
    assert after.estimate.found["payload.mass"] == pytest.approx(heavier.mass_kg, rel=0.003)

"""The EMPS axis, measured: the published least squares, and what asymmetric friction leaves."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from rigid_models import Slide, stacked
from robid.models.rigid.fit.cut_off import choose_cut_off
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.regression import huber, ordinary_least_squares, reduce_rows
from robid.models.rigid.fit.rows import Reading, prepare
from robid.models.rigid.fit.shots import Shot
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot

OPTIONS = PreprocessingOptions(position_cut_hz=100.0, decimation=10)
PERIOD_S = 1e-3


@pytest.fixture(scope="module")
def measured(data_folder):
    log = loadmat(data_folder("emps") / "DATA_EMPS.mat")
    return log["qm"], log["vir"] * log["gtau"].item()


def _fit(measured, regressor):
    rows = Reading([prepare(*measured, PERIOD_S, OPTIONS)], regressor, OPTIONS.decimator(PERIOD_S))
    reduction = reduce_rows(rows)
    found = ordinary_least_squares(reduction)
    columns, force = stacked(rows)
    relative = 100 * np.linalg.norm(force - columns @ found.parameters) / np.linalg.norm(force)
    return found, relative, np.linalg.cond(columns), (rows, reduction)


def test_parameters_condition_and_error_are_the_published_ones(measured):
    found, relative, condition, _ = _fit(measured, Slide())
    published = np.array([95.1089, 203.5034, 20.3935, -3.1648])
    assert np.all(np.abs(found.parameters / published - 1) < [0.01, 0.01, 0.01, 0.02])
    np.testing.assert_allclose(found.standard_deviation, [0.1085, 1.1460, 0.1012, 0.0444], rtol=0.03)
    assert condition == pytest.approx(25.9883, rel=0.01)
    assert relative == pytest.approx(4.0834, abs=0.1)


def test_asymmetric_friction_explains_more(measured):
    found, relative, _, _ = _fit(measured, Slide(asymmetric=True))
    np.testing.assert_allclose(found.parameters, [95.1540, 166.7061, 20.1440, 240.4236, 20.6277], rtol=0.01)
    assert relative == pytest.approx(3.1117, abs=0.1)


def test_huber_stays_near(measured):
    found, _, _, (rows, reduction) = _fit(measured, Slide())
    robust = huber(rows, reduction)
    np.testing.assert_allclose(robust.parameters[:3], found.parameters[:3], rtol=0.05)


def test_a_cut_off_is_found_above_what_the_axis_moves_at(measured):
    robot = load_robot(Path(__file__).parents[5] / "configs/robots/emps.yaml").to_robot(0.0)
    position, force = measured
    ratio = robot.gear_ratio
    choice = choose_cut_off(
        [Shot(position * ratio, force / ratio, PERIOD_S, held=False)], build_rigid_model(robot), PreprocessingOptions()
    )
    assert 1 < choice.motion_hz[0] < choice.cut_hz < 60
    assert choice.error[choice.trial_hz == choice.cut_hz] < 1.05 * choice.error.min()

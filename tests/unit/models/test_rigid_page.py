"""What the page shows of a rigid fit: each motor's errors, and where records are joined."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.parameters import parameter_rows
from robid.models.rigid.fit.cut_off import row_count
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.judge.motors import motors_of
from robid.models.rigid.judge.validating import validate_rigid
from robid.models.rigid.page import sections
from robid.report.parameters import Estimates
from robid.report.section import Beside, Figure

OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
LENGTHS = (3000, 1500, 2000)
NAMES = ("a", "b", "c")


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def shots(robot):
    return [shot_along(robot, fourier_motion(robot, length, seed=length)) for length in LENGTHS]


@pytest.fixture(scope="module")
def solution(robot, shots):
    return fit_rigid(robot, shots, OPTIONS)


def laid_out(solution, validation=None):
    estimates = Estimates(parameter_rows(solution.estimate, {}))
    return sections(solution, estimates, motors_of(solution, NAMES), validation)


def over_time(section):
    for part in section.parts:
        yield from [each for each in (part.parts if isinstance(part, Beside) else (part,)) if isinstance(each, Figure)]


def test_records_are_told_apart_where_they_are_joined(solution):
    residuals = solution.residuals
    step = residuals.time_s[1] - residuals.time_s[0]
    counts = [row_count(length, OPTIONS.filters, PERIOD_S) for length in LENGTHS]
    assert sum(counts) == len(residuals.time_s)
    (section,) = [each for each in laid_out(solution) if each.anchor == "residuals"]
    shown = [figure for figure in over_time(section) if figure.x_title == "Time [s]"]
    assert len(shown) == len(NAMES)
    for figure in shown:
        assert [line.along for line in figure.lines] == ["x", "x"]
        np.testing.assert_allclose([line.at for line in figure.lines], step * np.cumsum(counts)[:2], atol=2 * step)


def test_a_single_record_has_no_mark(robot, shots):
    (section,) = [each for each in laid_out(fit_rigid(robot, shots[:1], OPTIONS)) if each.anchor == "residuals"]
    assert not any(figure.lines for figure in over_time(section))


def test_each_motors_errors_stand_first(robot, solution):
    new = shot_along(robot, fourier_motion(robot, 2500, seed=8), noise=0.05)
    validation = validate_rigid(robot, solution, [new], OPTIONS)
    first, *_ = laid_out(solution, validation)
    rows = [row for table in first.tables for row in table.texts]
    assert [row[0] for row in rows] == list(NAMES)
    sizes = np.array([[float(row[place].split()[0]) for place in (1, 2, 5, 6)] for row in rows])
    found, error = solution.residuals, validation.prediction.measured - validation.prediction.predicted
    expected = [found.torque, found.residual, validation.prediction.measured, error]
    np.testing.assert_allclose(
        sizes, np.transpose([np.sqrt(np.nanmean(each**2, axis=0)) for each in expected]), rtol=6e-3
    )
    # What is told of another motion is about the noise that it was given, of its torque's deviation.
    spread = new.torque.std(axis=0) / np.sqrt(np.mean(new.torque**2, axis=0))
    assert sizes[:, 3].max() < 0.05 * (sizes[:, 2] * np.maximum(spread, 0.1)).max()
    assert validation.prediction.time_s[1] > PERIOD_S
    assert (
        len(laid_out(solution)[0].tables[0].columns) == len(first.tables[0].columns) - 1
    )  # two bounds for three errors

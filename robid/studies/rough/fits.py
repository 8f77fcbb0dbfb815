"""Rigid fits by rough files: what they say of themselves, and their true error on motions that they never saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.plausible import assess_rigid
from robid.models.rigid.judge.scales import Motions, rigid_scale_findings, sum_findings
from robid.models.rigid.judge.validating import predict, validate_rigid
from robid.results.grade import DO_NOT_USE
from robid.robot.description import Robot
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model

OPTIONS = RigidFitOptions(instruments="none")
"""Of a log without commands, as most are."""

RATED_SHARE = 0.1
"""Share of a motor's rated torque below which its torques are not what its error is compared with."""


@dataclass(frozen=True)
class Said:
    """What is said of a fit, and what it is."""

    grade: int  # Its grade; that of what must not be used where the data were refused
    sentence: str  # The grade in words, or why the data were refused
    error: FloatArray  # (n_joint,) true error of each motor on new motions; NaN where there is no fit
    bound: FloatArray  # (n_joint,) the 95 % bound of it that the fit states; NaN where it states none
    cut_hz: float  # Cut-off of its positions [Hz]; NaN where there is no fit
    condition: float  # Condition number of its columns; NaN where there is no fit


@dataclass(frozen=True)
class Judge:
    """What true errors are measured on."""

    robot: Robot  # The robot file's
    rated_nm: FloatArray  # (n_joint,) rated torques [N m]
    channels: Motions  # Channels of its logs
    new: Sequence[Shot]  # Motions that no fit sees
    band_hz: float  # Cut-off behind which motion and torque are compared [Hz]

    def error(self, solution: RigidSolution) -> FloatArray:
        """Returns the true error (n_joint,) of each motor of a fit on the new motions."""
        return motor_errors(self.robot, solution, self.new, self.rated_nm, self.band_hz, OPTIONS.model)


def motor_errors(
    robot: Robot,
    solution: RigidSolution,
    shots: Sequence[Shot],
    rated_nm: FloatArray,
    band_hz: float,
    form: RigidOptions,
) -> FloatArray:
    """Returns the RMS torque error (n_joint,) of each motor over its RMS torque, or 10 % of the rated one if larger.

    Args:
        robot: The robot that was fitted.
        solution: The fit.
        shots: Motions, taken together.
        rated_nm (n_joint,): Rated torques; 0 where none is known [N m].
        band_hz: Cut-off of positions; torques are compared in the band of its rows, whatever the fit's own was [Hz].
        form: What the model has beside its links.
    """
    whole = build_rigid_model(robot, form)
    model = whole.only([whole.names.index(name) for name in solution.estimate.names])
    found = predict(model, solution.estimate.value, shots, PreprocessingOptions(position_cut_hz=band_hz))
    size = np.sqrt(np.nanmean(found.measured**2, axis=0))
    return np.asarray(found.deviation / np.maximum(size, RATED_SHARE * rated_nm))


def judged(judge: Judge, fitted: Sequence[Shot], validation: Sequence[Shot] = ()) -> Said:
    """Fits to motions, validates on further ones where there are any, and holds both against the truth."""
    try:
        solution = fit_rigid(judge.robot, fitted, OPTIONS)
        scales = rigid_scale_findings(judge.robot, fitted, judge.channels, OPTIONS)
        grade = assess_rigid(judge.robot, solution, OPTIONS, scales or sum_findings(judge.robot, fitted, OPTIONS))
        if validation:
            grade = validate_rigid(judge.robot, solution, validation, OPTIONS, grade.findings).outcome.grade
    except DataError as refusal:
        nowhere = np.full(len(judge.robot.joints), np.nan)
        return Said(DO_NOT_USE, str(refusal), nowhere, nowhere, np.nan, np.nan)
    bound, found = solution.expected.bound, judge.error(solution)
    return Said(grade.value, grade.sentence, found, bound, solution.filtered.cut_hz, solution.base.condition)

"""What a single defect does to a fit by the truth: how far it moves springs, and whether the data could show it.

Both follow from the exact linear responses of the true robot with and without its defect, in the places that were
measured: the fit is repeated on both. The gears of the robot without it are those of their chains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.stats import chi2, ncx2

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import Weights
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.robot.in_line import with_chains
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.robot.zeros import with_zeros
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot, warmed
from robid.studies.settings.trust import TrustStudy
from robid.studies.simulated import kept_solution, read_responses
from robid.studies.study import Content, Earlier, Task, study_of
from robid.studies.trust.responses import RANDOM, Fitting, machines, make_fitting, simulated

_LEVEL = 0.05  # of the test whose power is told
_STEPS = 50
_LEAST = 1e-300


def effect_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each robot with a single defect."""
    study, known, models, found = study_of(run.loaded, TrustStudy), machines(run), earlier[1].by_name, list[Task]()
    for one in simulated(run):
        defect = None if study.single is None or one.kind != "single" else study.single.defect(one.group)
        if defect is not None:
            fitting = make_fitting(run, known[one.robot], one, RANDOM, earlier[0])[1]
            model = models[f"{one.key}_{RANDOM}"]
            decides = {"model": model.name, "named": list(defect.named), "level": _LEVEL}
            found.append(Task(one.key, decides, (fitting, model, defect.named)))
    return found


def tell_effect(fitting: Fitting, model: Path, named: Sequence[str]) -> Content:
    """Says how far a defect moves springs, and with which power a test shows it; nothing where no fit was made."""
    try:
        solution = kept_solution(read_artifact(model, TASK))
    except DataError:
        return Content({}, {})
    frf = read_responses(fitting.responses)
    both = exact_responses(fitting.robot, fitting.truth, frf)
    return Content(
        {}, {"moved": moved(fitting, solution, frf, both), "power": power(fitting, solution, frf, both, named)}
    )


Both: TypeAlias = tuple[ComplexArray, ComplexArray]
"""Responses (n_conf, n_freq, n_out, n_in) of a true robot with and without its defect."""


def exact_responses(nominal: Robot, true: TrueRobot, frf: Frf) -> Both:
    """Returns the exact linear responses of a true robot with and without its defect, where a response was measured."""
    zeros = {joint.name: -true.truth.zero_deg.get(joint.name, 0.0) for joint in nominal.joints}
    plain = with_zeros(true.robot, zeros)
    plain = replace(plain, springs=with_chains(plain, nominal.springs))
    late = np.exp(-2j * np.pi * frf.frequency_hz[:, None, None] * _late_s(true.truth, frf))
    flawed = _exact(true.robot, true.imperfections, true.delay_s, frf) * late
    return flawed, _exact(plain, Imperfections(), true.delay_s, frf)


def _exact(robot: Robot, flaws: Imperfections, delay_s: float, frf: Frf) -> ComplexArray:
    """Exact linear response in each configuration, friction as it has drifted and gears as stiff as they are bent."""
    found = []
    for index, configuration in enumerate(frf.configurations):
        own = warmed(robot, flaws, index)
        rest = solve_statics(build_model(own, balanced=True), configuration[None])
        bent = zip(own.springs, np.sign(rest.deflection[0]).tolist(), strict=True)
        springs = (
            replace(spring, stiffness=spring.stiffness * (1 + flaws.one_sided * way))
            if spring.place == "transmission"
            else spring
            for spring, way in bent
        )
        model = build_model(replace(own, springs=tuple(springs)), balanced=True)
        linear = linearize(model, solve_statics(model, configuration[None]), frf.output_names)
        parameters = nominal_parameters(model.robot, linear, delay_s)
        found.append(response(linear, parameters, frf.frequency_hz, frf.hold_period_s).sampled[0])
    return np.array(found)


def _late_s(truth: Truth, frf: Frf) -> FloatArray:
    """How much later than the others each element (n_out, n_in) is [s]."""
    torque = [truth.late_torque_s.get(name, 0.0) for name in frf.input_names]
    angle = [truth.late_angle_s.get(name, 0.0) for name in frf.output_names]
    return np.asarray(np.add.outer(np.array(angle), np.array(torque)))


def moved(fitting: Fitting, solution: ElasticSolution, frf: Frf, both: Both) -> float:
    """Returns how far a defect moves a spring at most, over the half width of its interval; with the fit's weights."""
    fitted = fitted_model(fitting.robot, solution, frf, fitting.options, fitting.delay_s)
    flawed, plain = (_refitted(fitted, exact).internal for exact in both)
    by_name = dict(zip(fitted.problem.parameters.names, (flawed - plain).tolist(), strict=True))
    estimate, found = solution.estimate, [0.0]
    for row, name in enumerate(estimate.names):
        if estimate.kinds[row] == "stiffness" and estimate.identifiable[row] and name in by_name:
            ends = np.maximum([estimate.lower[row], estimate.upper[row]], _LEAST)
            found.append(abs(by_name[name]) / (0.5 * float(np.log(ends[1] / ends[0]))))
    return max(found)


def power(fitting: Fitting, solution: ElasticSolution, frf: Frf, both: Both, named: Sequence[str]) -> float:
    """Returns the power of a test that knows what a defect leaves in the residuals, and looks for its amount.

    The noise is the measured one. What a robot file may have wrong by its priors may hide what the fit leaves; what is
    the defect itself, by one of the causes that it is named by, may not.
    """
    options = replace(fitting.options, weights=Weights(kind="optimal"))
    fitted = fitted_model(fitting.robot, solution, frf, options, fitting.delay_s)
    flawed, plain = (_refitted(fitted, exact) for exact in both)
    seen = _rows(flawed, (_residual(flawed) - _residual(plain))[..., None])[:, 0]
    others = tuple(each for each in list_nuisances(fitting.robot, options) if each.cause not in named)
    columns = nuisance_columns(flawed.problem, flawed.internal, fitting.robot, options, others, all_rest=False)
    known = _rows(flawed, np.concatenate([flawed.problem.linear(flawed.internal)[1], columns], axis=-1))
    std = np.array([each.common_std for each in others])
    prior = np.concatenate([0.5 / flawed.problem.parameters.prior_std**2, 0.5 / std**2])
    hidden = np.linalg.lstsq(known.T @ known + np.diag(prior), known.T @ seen, rcond=1e-14)[0]
    # Residuals count as complex ones of unit variance: half of it lies in each part.
    strength = 2 * float(seen @ seen - seen @ known @ hidden)
    return float(ncx2.sf(chi2.ppf(1 - _LEVEL, 1), 1, max(strength, 0.0)))


def _refitted(fitted: FittedModel, exact: ComplexArray) -> FittedModel:
    """The fit to a response without noise, weighted as before."""
    problem = replace(fitted.problem, frf=replace(fitted.problem.frf, response=exact))
    end = optimise(problem, fitted.internal, max_iterations=_STEPS)
    return replace(fitted, problem=problem, internal=end.parameters)


def _residual(fitted: FittedModel) -> ComplexArray:
    return fitted.problem.linear(fitted.internal)[0]


def _rows(fitted: FittedModel, values: ComplexArray) -> FloatArray:
    """Weighted real rows (n_row, n_column) of (n_conf, n_freq, n_out, n_in, n_column)."""
    flat = fitted.problem.weighted(values).reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])

"""The fits of the study of mistakes, and what each is worth: grades by the truth and as given, detectors, causes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.grading import telling_shares
from robid.models.elastic.judge.validating import Validation, validate_elastic
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline.graph import Run
from robid.results.finding import CAUSES
from robid.results.plausible.findings import data_findings
from robid.robot.description import Robot
from robid.settings.robot_parts import delay_s, plain_settings
from robid.studies.mistakes.responses import Case, campaigns_of, cases, mistaken_robot, mistaken_truth
from robid.studies.settings.mistakes import Mistake, MistakesStudy
from robid.studies.simulated import kept_or_refused, kept_solution, kept_truth, response_from
from robid.studies.study import Content, Earlier, Task, study_of

GRADING = 4
"""Raised when the rules of the grade change, so that the cases are graded anew."""

GRADES = ("do not use", "predicts", "trust")
"""Grades in words, by their value."""

COVERED = 0.9
HALF_WIDTHS = 3.0
SPRING_ERROR = 0.2


@dataclass(frozen=True)
class Against:
    """A fit against the truth."""

    spring_error: float  # Largest relative error of an identified spring; NaN where none is known
    half_widths: float  # Largest error of one over half its interval, both logarithmic; NaN where none is known
    coverage: float  # Share of the identified parameters whose interval holds the truth; NaN where none is known
    holds: bool  # Whether the validation passes

    @property
    def grade(self) -> int:
        """The grade that it deserves."""
        if not self.holds or self.spring_error > SPRING_ERROR:
            return 0
        covered = math.isnan(self.coverage) or self.coverage >= COVERED
        return 2 if covered and not self.half_widths > HALF_WIDTHS else 1


def against_truth(solution: ElasticSolution, validation: Validation, truth: dict[str, float]) -> Against:
    """Compares a fit and its validation with the truth."""
    estimate = solution.estimate
    known = np.array([name in truth for name in estimate.names]) & estimate.identified
    true = np.array([truth.get(name, np.nan) for name in estimate.names])
    covered = (estimate.lower <= true) & (true <= estimate.upper)
    springs = known & np.array([kind == "stiffness" for kind in estimate.kinds])
    found, lower, upper = (each[springs] / true[springs] for each in (estimate.value, estimate.lower, estimate.upper))
    widths = np.abs(np.log(found)) / np.maximum(0.5 * np.log(upper / lower), 1e-300)
    return Against(
        spring_error=float(np.abs(found - 1).max()) if springs.any() else math.nan,
        half_widths=float(widths.max()) if springs.any() else math.nan,
        coverage=float(covered[known].mean()) if known.any() else math.nan,
        holds=validation.outcome.ok,
    )


def about_doubts(values: Sequence[Any], kind: type = str) -> Dataset:
    """Returns what a task keeps of each finding that speaks against a fit."""
    return Dataset(np.array(values, dtype=kind), "1", ("doubt",))


def refused_causes(robot: Robot, frf: Frf | None, text: str, delay_s: float = 0.0) -> tuple[str, ...]:
    """Returns the causes that the tool names where it refuses data, by its text and the response, in their order."""
    seen = () if frf is None else tuple(doubt.cause for doubt in data_findings(robot, frf, delay_s))
    named = sorted((text.find(words), cause) for cause, words in CAUSES.items() if words in text)
    return tuple(dict.fromkeys((*seen, *(cause for _, cause in named))))


@dataclass(frozen=True)
class Fitting:
    """The fit of a case."""

    responses: Path
    response: str
    robots: tuple[Robot, Robot]
    options: ElasticOptions
    delay_s: float


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the fit of each case."""
    responses = earlier[0].by_name
    fits = ((case, *_fitting(run, case, responses[case.simulation])) for case in cases(run))
    return [Task(case.key, decides, (fitting,)) for case, decides, fitting in fits]


def case_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the judgement of each case."""
    found, responses = [], earlier[0].by_name
    for case, model in zip(cases(run), earlier[1].paths, strict=True):
        _, fitting = _fitting(run, case, responses[case.simulation])
        named, cause = {"case": case.name, "robot": case.subject.name}, case.mistake.cause or ""
        about: dict[str, Attribute] = {**named, "seed": case.seed, "cause": cause}
        decides = {"model": model.name, "grading": GRADING, **about}
        found.append(Task(case.key, decides, (fitting, model, case.mistake, about)))
    return found


def _fitting(run: Run, case: Case, responses: Path) -> tuple[dict[str, Any], Fitting]:
    loaded = case.subject.run.loaded
    loaded = replace(loaded, robot=mistaken_robot(loaded.robot, case.mistake))
    fit = study_of(run.loaded, MistakesStudy).fit
    options = elastic_fit(loaded.experiment, fit).options()
    names = campaigns_of(loaded, fit).values()
    own, new = (loaded.experiment.campaigns[name] for name in names)
    robots = loaded.robot.to_robot(own.payload_kg), loaded.robot.to_robot(new.payload_kg)
    settings = [model_settings(loaded, name) for name in names]
    decides = {"responses": responses.name, "response": case.response, "options": plain_settings(options)}
    return {**decides, "settings": settings}, Fitting(responses, case.response, robots, options, delay_s(loaded, own))


def fit_case(one: Fitting) -> Content:
    """Fits a case, or says why it was refused."""
    frf = partial(_response, read_artifact(one.responses, TASK), one, "estimation")
    return kept_or_refused(lambda: fit_elastic(one.robots[0], frf(), one.options, one.delay_s))


def _response(held: Artifact, one: Fitting, campaign: str) -> Frf:
    return response_from(held, f"{one.response}/{campaign}/")


def judge_case(fitting: Fitting, model: Path, mistake: Mistake, about: dict[str, Attribute]) -> Content:
    """Validates and grades a case, and holds it against the truth."""
    held, responses = read_artifact(model, TASK), read_artifact(fitting.responses, TASK)
    truth = mistaken_truth(kept_truth(responses), mistake)
    frf: Frf | None = None
    try:
        frf = _response(responses, fitting, "estimation")
        solution = kept_solution(held)
        new = _response(responses, fitting, "validation")
        doubts = assess_fit(fitting.robots[0], solution, frf, fitting.options, fitting.delay_s).findings
        validation = validate_elastic(fitting.robots[1], solution, new, fitting.options, fitting.delay_s, truth, doubts)
    except DataError as error:
        # Nothing may be used of what was refused, which no truth contradicts.
        causes = refused_causes(fitting.robots[0], frf, str(error), fitting.delay_s)
        return Content({"causes": about_doubts(causes)}, {**about, "refusal": str(error), "given": 0, "right": 0})
    return _content(about, solution, validation, against_truth(solution, validation, truth))


def _content(about: dict[str, Attribute], solution: ElasticSolution, validation: Validation, truth: Against) -> Content:
    error, grade = solution.model_error, validation.outcome.grade
    shares = dict.fromkeys(("share_above", "share_correlated", "telling_above", "telling_correlated"), float("nan"))
    if error is not None:
        shares = dict(zip(shares, (error.share_above, error.share_correlated, *telling_shares(error)), strict=True))
    keys = ("cost_ratio", "motor_error_db", "motor_error_deg", "median_error_db", "worst_error_db")
    attributes: dict[str, Attribute] = {
        **about,
        **shares,
        **{key: getattr(validation, key) for key in keys},
        "given": grade.value,
        "right": truth.grade,
        "holds": truth.holds,
        "worst_spring_error": truth.spring_error,
        "worst_half_widths": truth.half_widths,
        "coverage": truth.coverage,
        "status": solution.estimate.status,
        "misfit": solution.misfit,
        "reasons": "; ".join(grade.reasons),
        "resonance_shift": float("nan") if validation.resonance_shift is None else validation.resonance_shift,
        "validation_ok": validation.outcome.ok,
    }
    kept: dict[str, tuple[str, type]] = {"causes": ("cause", str), "messages": ("message", str)}
    kept |= {"decisive": ("decisive", bool), "strength": ("strength", float)}
    datasets = {
        **{name: about_doubts([getattr(one, key) for one in grade.findings], of) for name, (key, of) in kept.items()},
        "error_db": Dataset(validation.error_db, "dB", ("configuration", "motor"), "Median of the own responses"),
        "cost": Dataset(validation.cost, "1", ("configuration",), "Validation cost"),
        "expected_cost": Dataset(validation.expected_cost, "1", ("configuration",), "By the covariance alone"),
        "elements": Dataset(validation.elements, "1", ("configuration",), "Response elements with weight"),
    }
    return Content(datasets, attributes)

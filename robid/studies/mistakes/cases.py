"""The fits of the study of mistakes, and what each is worth: truth, detectors, grade and causes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_content, solution_from_artifact
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.grading import telling_shares
from robid.models.elastic.judge.validating import Validation, validate_elastic
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, plain_settings
from robid.studies.mistakes.grades import GRADING, Against, against_truth, refused_causes
from robid.studies.mistakes.mistaken import mistaken_robot, mistaken_truth
from robid.studies.mistakes.responses import read_response, read_true_values
from robid.studies.mistakes.study import Case, campaigns_of, cases, study_of
from robid.studies.settings.study import Mistake
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task


@dataclass(frozen=True)
class Fitting:
    """The fit of a case.

    Attributes:
        responses: Where the responses of its simulation lie.
        response: Name of its own.
        robots: The robot file's, with the payloads of estimation and validation.
        options: Options of the fit.
        delay_s: Nominal delay [s].
    """

    responses: Path
    response: str
    robots: tuple[Robot, Robot]
    options: ElasticOptions
    delay_s: float


@dataclass(frozen=True)
class Judged:
    """A fit to be judged.

    Attributes:
        fitting: How it was made.
        model: Where it lies.
        mistake: What is wrong.
        about: Names of its mistake and robot, and its seed.
    """

    fitting: Fitting
    model: Path
    mistake: Mistake
    about: dict[str, Attribute]


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the fit of each case."""
    return [Task(case.key, *_fitting(run, case, _place(case, earlier[0].paths))) for case in cases(run)]


def case_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the judgement of each case."""
    found = []
    for case, model in zip(cases(run), earlier[1].paths, strict=True):
        _, fitting = _fitting(run, case, _place(case, earlier[0].paths))
        about: dict[str, Attribute] = {"case": case.name, "robot": case.subject.name, "seed": case.seed}
        about["cause"] = case.mistake.cause or ""
        decides = {"model": model.name, "grading": GRADING, **about}
        found.append(Task(case.key, decides, Judged(fitting, model, case.mistake, about)))
    return found


def _place(case: Case, paths: tuple[Path, ...]) -> Path:
    return next(path for path in paths if path.name.startswith(f"{case.simulation}."))


def _fitting(run: Run, case: Case, responses: Path) -> tuple[dict[str, Any], Fitting]:
    loaded: LoadedExperiment = case.subject.loaded
    loaded = replace(loaded, robot=mistaken_robot(loaded.robot, case.mistake))
    fit = study_of(run.loaded).fit
    options = elastic_fit(loaded.experiment, fit).options()
    used = [loaded.experiment.campaigns[name] for name in campaigns_of(loaded, fit).values()]
    robots = loaded.robot.to_robot(used[0].payload_kg), loaded.robot.to_robot(used[1].payload_kg)
    decides = {
        "responses": responses.name,
        "response": case.response,
        "options": plain_settings(options),
        "settings": [model_settings(loaded, name) for name in campaigns_of(loaded, fit).values()],
    }
    return decides, Fitting(responses, case.response, robots, options, delay_s(loaded, used[0]))


def fit_case(one: Fitting) -> Content:
    """Fits a case, or says why it was refused."""
    try:
        frf = read_response(read_artifact(one.responses, TASK), one.response, "estimation")
        solution = fit_elastic(one.robots[0], frf, one.options, one.delay_s)
    except DataError as error:
        return Content({}, {"refusal": str(error)})
    return Content(*solution_content(solution))


def judge_case(one: Judged) -> Content:
    """Validates and grades a case, and holds it against the truth."""
    held, responses = read_artifact(one.model, TASK), read_artifact(one.fitting.responses, TASK)
    fitting, truth = one.fitting, mistaken_truth(read_true_values(responses), one.mistake)
    frf: Frf | None = None
    try:
        frf = read_response(responses, fitting.response, "estimation")
        solution = _solution(held)
        new = read_response(responses, fitting.response, "validation")
        doubts = assess_fit(fitting.robots[0], solution, frf, fitting.options, fitting.delay_s).doubts
        validation = validate_elastic(fitting.robots[1], solution, new, fitting.options, fitting.delay_s, truth, doubts)
    except DataError as error:
        return _refused(one, frf, str(error))
    return _content(one, solution, validation, against_truth(solution, validation, truth))


def _solution(held: Artifact) -> ElasticSolution:
    refusal = held.attributes.get("refusal")
    if refusal is not None:
        raise DataError(str(refusal))
    return solution_from_artifact(held)


def _refused(one: Judged, frf: Frf | None, text: str) -> Content:
    """What a refusal amounts to: nothing may be used, which no truth contradicts."""
    causes = np.array(refused_causes(one.fitting.robots[0], frf, text, one.fitting.delay_s), dtype=str)
    return Content({"causes": Dataset(causes, "1", ("doubt",))}, {**one.about, "refusal": text, "given": 0, "right": 0})


def _content(one: Judged, solution: ElasticSolution, validation: Validation, truth: Against) -> Content:
    error, axis, doubts = solution.model_error, ("doubt",), validation.outcome.grade.doubts
    shares = (float("nan"), float("nan")) if error is None else telling_shares(error)
    attributes: dict[str, Attribute] = {
        **one.about,
        "given": validation.outcome.grade.value,
        "right": truth.grade,
        "holds": truth.holds,
        "worst_spring_error": truth.spring_error,
        "worst_half_widths": truth.half_widths,
        "coverage": truth.coverage,
        "status": solution.estimate.status,
        "misfit": solution.misfit,
        "share_above": float("nan") if error is None else error.share_above,
        "share_correlated": float("nan") if error is None else error.share_correlated,
        "telling_above": shares[0],
        "telling_correlated": shares[1],
        "cost_ratio": validation.cost_ratio,
        "reasons": "; ".join(validation.outcome.grade.reasons),
        "motor_error_db": validation.motor_error_db,
        "motor_error_deg": validation.motor_error_deg,
        "resonance_shift": float("nan") if validation.resonance_shift is None else validation.resonance_shift,
        "median_error_db": validation.median_error_db,
        "worst_error_db": validation.worst_error_db,
        "validation_ok": validation.outcome.ok,
    }
    datasets = {
        "causes": Dataset(np.array([doubt.cause for doubt in doubts], dtype=str), "1", axis),
        "messages": Dataset(np.array([doubt.message for doubt in doubts], dtype=str), "1", axis),
        "decisive": Dataset(np.array([doubt.decisive for doubt in doubts], dtype=bool), "1", axis),
        "strength": Dataset(np.array([doubt.strength for doubt in doubts], dtype=float), "1", axis),
        "error_db": Dataset(validation.error_db, "dB", ("configuration", "motor"), "Median of the own responses"),
        "cost": Dataset(validation.cost, "1", ("configuration",), "Validation cost"),
        "expected_cost": Dataset(validation.expected_cost, "1", ("configuration",), "By the covariance alone"),
        "elements": Dataset(validation.elements, "1", ("configuration",), "Response elements with weight"),
    }
    return Content(datasets, attributes)

"""The grades of the study of trust: what a fit is said to be worth, and which cause is named."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid.artifacts.artifact import Attribute, Dataset
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.validating import validate_elastic
from robid.pipeline import Run
from robid.results.doubt import Doubt
from robid.studies.mistakes.grades import GRADING, refused_causes
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task
from robid.studies.trust.models import Fitting, make_fitting, model_name, read_model
from robid.studies.trust.responses import REFUSAL, files_of, read_responses, simulated
from robid.studies.trust.study import FRESH, RANDOM, machines, study_of


@dataclass(frozen=True)
class Graded:
    """A fit to be graded.

    Attributes:
        fitting: How it was made.
        model: Where it lies.
        fresh: Where the responses lie that it is validated on; none for one whose cause alone is asked for.
    """

    fitting: Fitting
    model: Path
    fresh: tuple[Path, ...]


def grade_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each robot that is simulated."""
    known, study = machines(run), study_of(run.loaded)
    models = {path.name.split(".")[0]: path for path in earlier[1].paths}
    found = []
    for one in simulated(run):
        fitting = make_fitting(run, known[one.robot], one, RANDOM, earlier[0])[1]
        model = models[model_name(one, RANDOM)]
        fresh = files_of(earlier[0], one, FRESH)[: study.validated_in]
        decides = {"model": model.name, "fresh": [path.name for path in fresh], "grading": GRADING}
        found.append(Task(one.key, decides, Graded(fitting, model, fresh)))
    return found


def grade_individual(one: Graded) -> Content:
    """Says what speaks against a fit and, with places to validate in, which grade it gets."""
    held = read_artifact(one.model, TASK)
    model, fitting = read_model(held), one.fitting
    if model is None:
        return _refused(fitting, None, str(held.attributes[REFUSAL]))
    frf = read_responses(fitting.responses)
    try:
        doubts = assess_fit(fitting.robot, model[0], frf, fitting.options, fitting.delay_s).doubts
        if not one.fresh:
            return _content(doubts, {})
        new = read_responses(one.fresh)
        validation = validate_elastic(fitting.robot, model[0], new, fitting.options, fitting.delay_s, model[1], doubts)
    except DataError as error:
        return _refused(fitting, frf, str(error))
    return _content(validation.outcome.grade.doubts, {"grade": validation.outcome.grade.value})


def _refused(fitting: Fitting, frf: Frf | None, text: str) -> Content:
    """What a refusal amounts to: nothing may be used."""
    causes = refused_causes(fitting.robot, frf, text, fitting.delay_s)
    return Content({"causes": _texts(causes)}, {REFUSAL: text, "grade": 0})


def _content(doubts: tuple[Doubt, ...], attributes: dict[str, Attribute]) -> Content:
    datasets = {
        "causes": _texts(tuple(doubt.cause for doubt in doubts)),
        "messages": _texts(tuple(doubt.message for doubt in doubts)),
    }
    return Content(datasets, attributes)


def _texts(texts: tuple[str, ...]) -> Dataset:
    return Dataset(np.array(texts, dtype=str), "1", ("doubt",))

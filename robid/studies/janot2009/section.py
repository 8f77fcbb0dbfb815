"""The study's section of an experiment file."""

from __future__ import annotations

from robid.settings.load import LoadedExperiment
from robid.studies.settings.study import JanotStudy


def study_of(loaded: LoadedExperiment) -> JanotStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, JanotStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study

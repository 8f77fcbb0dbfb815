"""A fit that frees more than its settings say, from the minimum found: what would change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import SettingsError
from robid.models.family import Work, family_of
from robid.settings.load import LoadedExperiment
from robid.stages.chain.fit import STAGE
from robid.stages.fit import read_data
from robid.stages.stage import Job


@dataclass(frozen=True)
class Trial:
    """A fit and what it becomes.

    Attributes:
        before: The model of the fit.
        after: The model with more freed.
        torque_unit: What stands for N m in both.
    """

    before: Artifact
    after: Artifact
    torque_unit: str


def tried_experiment(loaded: LoadedExperiment, fit: str, names: Sequence[str]) -> LoadedExperiment:
    """Returns the experiment with more names in a fit's `free`.

    Raises:
        SettingsError: If the fit's family has nothing to free, or no robot has such a thing.
    """
    family = family_of(loaded, fit)
    if family.free_too is None:
        known = ", ".join(sorted(name for name, each in loaded.families.items() if getattr(each, "free_too", None)))
        message = f"a fit of family `{family.name}` has nothing to try"
        raise SettingsError(message, where="--try", remedy=f"it belongs to fits of family {known}")
    return family.free_too(loaded, fit, names)


def try_fit(tried: LoadedExperiment, fit: str, inputs: Mapping[str, Path], work: Work) -> Trial:
    """Refits from the minimum found, in memory.

    Args:
        tried: What `tried_experiment` returned.
        fit: Name of the fit.
        inputs: What the fit reads, and its `model`.
        work: How it is computed.
    """
    family, before = family_of(tried, fit), read_artifact(inputs["model"], MODEL)
    if family.refit is None:
        message = f"family {family.name} frees what it cannot fit"
        raise RuntimeError(message)
    data = read_data(tried, fit, {name: path for name, path in inputs.items() if name != "model"})
    unit = "N m" if data.frf is None else data.frf.input_unit
    return Trial(before, family.refit(data, before, work), unit)


def write_tried(trial: Trial, job: Job) -> None:
    """Writes the model with more freed; its settings say where it began, so that it is no fit's own."""
    job = replace(job, settings={**job.settings, "begun_at": "the minimum of another fit"})
    write_artifact(job.output, replace(trial.after, provenance=job.provenance(STAGE.name)))

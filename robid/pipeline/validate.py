"""validate: a fitted model on a campaign that its fit never saw, no sample of which is the fit's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.kinds import FILES, FRF, RECORD, files_from_artifact, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact, read_outline, write_artifact
from robid.artifacts.truth import read_truth
from robid.errors import DataError
from robid.models.family import Data, family_of
from robid.pipeline.fit import read_taken
from robid.pipeline.stage import Job
from robid.results.copies import Copy, find_copy, take_excerpt
from robid.settings.fits import FitSettings
from robid.settings.load import LoadedExperiment
from robid.signals.record import Record


def run(job: Job) -> str:
    """Validates a model; returns what it found."""
    family, inputs = family_of(job.loaded, job.owner), job.inputs
    fit = job.loaded.experiment.fits[job.owner]
    campaigns, new = job.loaded.experiment.campaigns, fit.validate_on or fit.campaign
    alike = [name for name in fit.campaigns if campaigns[name].is_response == campaigns[new].is_response]
    seen = {name: inputs[f"seen_{name}"] for name in alike}
    refuse = refuse_same_files if campaigns[new].is_response else refuse_copies
    refuse(fit, seen, inputs["new_record"])
    frf = frf_from_artifact(read_artifact(inputs["frf"], FRF)) if "frf" in inputs else None
    records = (record_from_artifact(read_artifact(inputs["record"], RECORD)),) if "record" in inputs else ()
    true = read_truth(inputs["truth"], inputs["true_record"]) if "truth" in inputs else None
    taken = read_taken(fit, inputs)
    data = Data(job.loaded, job.owner, frf, records, taken=taken)
    found = family.validate(data, read_artifact(inputs["model"], MODEL), true)
    made = replace(found, provenance=job.provenance())
    write_artifact(job.output, made)
    return family.verdict(made)


def phrase(loaded: LoadedExperiment, owner: str, output: Path) -> str:
    """Reads what a validation found, in a phrase."""
    return family_of(loaded, owner).verdict(read_artifact(output, VALIDATION))


_SAME_PLACE = 1e-3  # rad, or m
_SAMPLES = ("inputs", "outputs", "reference")


def refuse_same_files(_fit: FitSettings, seen: Mapping[str, Path], new: Path) -> None:
    """Compares the files of responses of a fit with new ones.

    Raises:
        DataError: If the content of one is the same.
    """
    mine = files_from_artifact(read_artifact(new, FILES))
    for campaign, path in seen.items():
        theirs = files_from_artifact(read_artifact(path, FILES))
        for name, digest in zip(mine.names, mine.sha256, strict=True):
            if digest in theirs.sha256:
                what = f"D634 the {name} has the same content as a file of `{campaign}`, which the fit has read"
                raise DataError(what, where="validate_on", remedy="validate on responses that were measured separately")


def refuse_copies(fit: FitSettings, seen: Mapping[str, Path], new: Path) -> None:
    """Compares the records of a fit with a new one in every configuration that both have.

    Each configuration is read once; of the new ones short windows are kept, and a new one is read again only where
    one of its windows comes back.

    Raises:
        DataError: If samples of the fit come back in the new record.
    """
    mine, theirs = _places(new), list(_of_fit(fit, seen))
    excerpts = {
        row: take_excerpt(_read(new, row))
        for row, place in enumerate(mine)
        if any(_may_share(place, old_place) for _, _, old_place in theirs)
    }
    for campaign, old_row, old_place in theirs:
        rows = [row for row in excerpts if _may_share(mine[row], old_place)]
        if not rows:
            continue
        old = _read(seen[campaign], old_row)
        for row in rows:
            read = partial(_read, new, row)
            found = find_copy(old, excerpts[row], read)
            if found is not None:
                raise _refusal(found, campaign, row, read())


def _of_fit(fit: FitSettings, seen: Mapping[str, Path]) -> Iterator[tuple[str, int, FloatArray | None]]:
    """Campaign, row and place of each configuration that the fit has used."""
    counted = 0
    for campaign, path in seen.items():
        places = _places(path)
        for row, place in enumerate(places):
            if fit.configurations is None or counted + row in fit.configurations:
                yield campaign, row, place
        counted += len(places)


def _places(path: Path) -> list[FloatArray | None]:
    """Where a record's configurations are; None where it does not say."""
    rows = read_outline(path, RECORD).n_rows
    datasets = read_artifact(path, RECORD, leave_out=_SAMPLES).datasets
    return [
        np.asarray(datasets["configurations"].values[row]) if "configurations" in datasets else None
        for row in range(rows)
    ]


def _may_share(place: FloatArray | None, other: FloatArray | None) -> bool:
    """Whether two configurations may be one; those that are not stated may be any."""
    if place is None or other is None:
        return True
    return place.shape == other.shape and bool(np.all(np.abs(place - other) < _SAME_PLACE))


def _read(path: Path, row: int) -> Record:
    return record_from_artifact(read_artifact(path, RECORD, row=row))


def _refusal(found: Copy, campaign: str, row: int, new: Record) -> DataError:
    place = f"configuration {row + 1}, realization {found.realization + 1}, experiment {found.experiment + 1}"
    old = f"`{campaign}`, realization {found.old_realization + 1}, experiment {found.old_experiment + 1}"
    what = (
        f"D198 {place} of the validation contains samples of the fit: {found.count} from sample {found.first + 1} on "
        "are those"
        f" of {old}, from sample {found.old_first + 1} on"
    )
    remedy = "validate on another recording"
    if not new.is_one_shot:
        remedy += ", or on periods that the fit does not use (`drop_periods`, `periods`, `take`)"
    return DataError(what, where="validation", remedy=remedy)

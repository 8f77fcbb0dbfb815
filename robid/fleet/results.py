"""What a row found: one entry for each parameter of each fit, and how badly each fits, as plain values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.results import MODEL, VALIDATION, estimate_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.models.family import family_of
from robid.results.estimate import Estimate
from robid.robot.parameters import owner_of
from robid.settings.load import LoadedExperiment


def results_of(loaded: LoadedExperiment, folder: Path) -> list[dict[str, Any]]:
    """Reads the parameters of all fits of a row.

    Args:
        loaded: Its experiment.
        folder: Its folder.

    Returns:
        Entries with the names and units of the columns of the table, see `robid.fleet.table.PARAMETER_COLUMNS`.
    """
    joints = {joint.name: joint.name for joint in loaded.robot.joints} | _joints_of_springs(loaded)
    found: list[dict[str, Any]] = []
    for fit in loaded.experiment.fits:
        path = folder / "fits" / fit / "model.h5"
        estimate = estimate_from_artifact(read_artifact(path, MODEL))
        digest = read_header(path).content_sha256
        for entry in [*_own(estimate), *_tied(estimate)]:
            owner = owner_of(entry["parameter"], entry["kind"])
            found.append({"fit": fit, **entry, "joint": joints.get(owner, ""), "model_sha256": digest})
    return found


def misfits_of(loaded: LoadedExperiment, folder: Path) -> dict[str, dict[str, float]]:
    """Reads how badly the model of each fit of a row describes data; see `Family.misfits`."""
    found = {}
    for fit in loaded.experiment.fits:
        path = folder / "fits" / fit / "validation.h5"
        validation = read_artifact(path, VALIDATION) if path.exists() else None
        told = family_of(loaded, fit).misfits(read_artifact(path.with_name("model.h5"), MODEL), validation)
        found[fit] = {name: float(value) for name, value in told.items() if np.isfinite(value) and value > 0}
    return found


def _joints_of_springs(loaded: LoadedExperiment) -> dict[str, str]:
    return {spring.name: spring.joint for spring in loaded.robot.all_springs if spring.joint is not None}


def _own(estimate: Estimate) -> list[dict[str, Any]]:
    columns: dict[str, Any] = {
        "parameter": estimate.names,
        "kind": estimate.kinds,
        "unit": estimate.units,
        "nominal": estimate.nominal,
        "estimate": estimate.value,
        "standard_deviation": np.sqrt(np.diagonal(estimate.covariance)),
        "effective": estimate.effective_value,
        "effective_low": estimate.effective_lower,
        "effective_high": estimate.effective_upper,
        "physical": estimate.middle,
        "physical_low": estimate.lower,
        "physical_high": estimate.upper,
        "relative_standard_deviation": estimate.relative_std,
        "predicted_relative_standard_deviation": estimate.predicted_relative_std,
        "identifiable": estimate.identifiable,
        "identified": estimate.identified,
    }
    listed = {name: np.asarray(values).tolist() for name, values in columns.items() if values is not None}
    both = {"confidence": estimate.confidence, "tied_to": ""}
    return [
        {**{name: values[index] for name, values in listed.items()}, **both} for index in range(len(estimate.names))
    ]


def _tied(estimate: Estimate) -> list[dict[str, Any]]:
    """Parameters that follow another one: of its kind and unit."""
    found = []
    tied, leaders = estimate.tied, {name: index for index, name in enumerate(estimate.names)}
    for index, (name, leader) in enumerate(zip(tied.names, tied.to, strict=True)):
        of = leaders[leader]
        found.append(
            {
                "parameter": name,
                "kind": estimate.kinds[of],
                "unit": estimate.units[of],
                "nominal": float(tied.nominal[index]),
                "estimate": float(tied.value[index]),
                "physical_low": float(tied.lower[index]),
                "physical_high": float(tied.upper[index]),
                "identifiable": bool(estimate.identifiable[of]),
                "identified": bool(estimate.identified[of]),
                "confidence": estimate.confidence,
                "tied_to": leader,
            }
        )
    return found

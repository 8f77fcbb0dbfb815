"""The position-dependent family: one sparse state-space model from responses at several positions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robid.later import later
from robid.models.family import Export, Family

if TYPE_CHECKING:
    from robid.models.lpv.fit.model import LpvModel

with later(__name__):
    from robid.models.lpv.files import read_model, write_hdf5, write_json, write_mat
    from robid.models.lpv.fitting import fit, misfits, phrase_of_model, validate
    from robid.models.lpv.page import report
    from robid.models.lpv.settings import LpvFit, problems


def evaluate(path: Path | str) -> LpvModel:
    """Reads a model: of a run folder's `model.h5`, or of an export as JSON or HDF5.

    `evaluate(path).at(points)` gives A(p), B(p), C(p) and D(p) at points (n_point, n_scheduling).

    Raises:
        ArtifactError: If it holds no model of this family.
    """
    return read_model(Path(path))


LPV = Family(
    name="lpv",
    settings=LpvFit,
    reads=("frf",),
    problems=problems,
    decides=lambda loaded, _campaign: {"robot.joints.name": [joint.name for joint in loaded.robot.joints]},
    fit=fit,
    validate=validate,
    phrase=phrase_of_model,
    report=report,
    exports={
        "json": Export("lpv.json", (".json",), write_json, takes_configuration=False),
        "mat": Export("lpv.mat", (".mat",), write_mat, takes_configuration=False),
        "hdf5": Export("lpv.h5", (".h5",), write_hdf5, takes_configuration=False),
    },
    needs_robot=False,
    misfits=misfits,
)

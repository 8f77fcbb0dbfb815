"""The position-dependent family: one sparse state-space model from responses at several positions."""

from __future__ import annotations

from robid.later import later
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.lpv.files import evaluate as evaluate
    from robid.models.lpv.files import write_hdf5, write_json, write_mat
    from robid.models.lpv.fitting import fit, misfits, phrase_of_model, validate
    from robid.models.lpv.page import report
    from robid.models.lpv.settings import LpvFit, problems

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

"""The external family: transfer functions from commands to positions."""

from __future__ import annotations

from robid.later import later
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.external.files import write_control, write_csv, write_json, write_mat
    from robid.models.external.fitting import compare, fit, misfits, phrase_of_model, validate
    from robid.models.external.page.report import report
    from robid.models.external.settings import ExternalFit, problems

EXTERNAL = Family(
    name="external",
    settings=ExternalFit,
    reads=("record",),
    problems=problems,
    decides=lambda _loaded, _campaign: {},
    fit=fit,
    validate=validate,
    phrase=phrase_of_model,
    report=report,
    exports={
        "json": Export("transfer.json", (".json",), write_json, takes_configuration=False),
        "csv": Export("transfer.csv", (".csv",), write_csv, takes_configuration=False),
        "mat": Export("transfer.mat", (".mat",), write_mat, takes_configuration=False),
        "control": Export("transfer_functions.py", (".py",), write_control, takes_configuration=False),
    },
    compare=compare,
    needs_robot=False,
    misfits=misfits,
)

"""The external family: transfer functions from commands to positions."""

from __future__ import annotations

from robid.later import later
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.external.files import write_control, write_csv, write_json, write_mat
    from robid.models.external.fitting import compare, fit, misfits, phrase_of_model, validate
    from robid.models.external.of_responses.family import fit as fit_response
    from robid.models.external.of_responses.family import misfits as misfits_of_response
    from robid.models.external.of_responses.family import phrase_of_model as phrase_of_response
    from robid.models.external.of_responses.family import validate as validate_response
    from robid.models.external.of_responses.files import write_control as write_response_control
    from robid.models.external.of_responses.files import write_csv as write_response_csv
    from robid.models.external.of_responses.files import write_json as write_response_json
    from robid.models.external.of_responses.files import write_mat as write_response_mat
    from robid.models.external.of_responses.page import report as report_of_response
    from robid.models.external.page.report import report
    from robid.models.external.settings import ExternalFit, problems

_OF_RESPONSES = Family(
    name="external",
    settings=ExternalFit,
    reads=("frf",),
    problems=problems,
    decides=lambda _loaded, _campaign: {},
    fit=fit_response,
    validate=validate_response,
    phrase=phrase_of_response,
    report=report_of_response,
    exports={
        "json": Export("transfer.json", (".json",), write_response_json, takes_configuration=False),
        "csv": Export("transfer.csv", (".csv",), write_response_csv, takes_configuration=False),
        "mat": Export("transfer.mat", (".mat",), write_response_mat, takes_configuration=False),
        "control": Export("transfer_functions.py", (".py",), write_response_control, takes_configuration=False),
    },
    needs_robot=False,
    misfits=misfits_of_response,
)
"""The family where campaigns have responses alone."""

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
    of_responses=_OF_RESPONSES,
)

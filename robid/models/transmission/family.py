"""The transmission family: gears from encoders on both of their sides."""

from __future__ import annotations

from robid.later import later
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.transmission.files import write_csv, write_json, write_mat
    from robid.models.transmission.fitting import fit, misfits, phrase_of_model, validate, values_in
    from robid.models.transmission.page.report import report
    from robid.models.transmission.settings import TransmissionFit, model_settings, problems

TRANSMISSION = Family(
    name="transmission",
    settings=TransmissionFit,
    reads=("record",),
    problems=problems,
    decides=model_settings,
    fit=fit,
    validate=validate,
    phrase=phrase_of_model,
    report=report,
    exports={
        "json": Export("gears.json", (".json",), write_json, takes_configuration=False),
        "csv": Export("gears.csv", (".csv",), write_csv, takes_configuration=False),
        "mat": Export("gears.mat", (".mat",), write_mat, takes_configuration=False),
    },
    true_values=values_in,
    misfits=misfits,
)

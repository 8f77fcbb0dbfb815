"""The elastic family: springs and dampers from frequency responses."""

from __future__ import annotations

from robid.later import later
from robid.models.elastic.settings import ElasticFit, model_settings, problems
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.elastic.fitting import (
        fit,
        misfits,
        phrase_of_model,
        refit,
        validate,
        values_in,
        verdict_of_validation,
    )
    from robid.models.elastic.freed import free_too
    from robid.models.elastic.page.report import compare, report
    from robid.models.elastic.writing import write_csv, write_json, write_mat, write_mjcf, write_state_space

ELASTIC = Family(
    name="elastic",
    settings=ElasticFit,
    reads=("frf",),
    problems=problems,
    decides=model_settings,
    fit=fit,
    validate=validate,
    phrase=phrase_of_model,
    report=report,
    exports={
        "mjcf": Export("model.xml", (".xml",), write_mjcf, takes_friction=True),
        "json": Export("parameters.json", (".json",), write_json, takes_configuration=False),
        "csv": Export("parameters.csv", (".csv",), write_csv, takes_configuration=False),
        "mat": Export("model.mat", (".mat",), write_mat),
        "statespace": Export("statespace.mat", (".mat", ".json", ".npz"), write_state_space),
    },
    seed=lambda settings: settings.seed if isinstance(settings, ElasticFit) else None,
    true_values=values_in,
    verdict=verdict_of_validation,
    compare=compare,
    free_too=free_too,
    refit=refit,
    misfits=misfits,
)

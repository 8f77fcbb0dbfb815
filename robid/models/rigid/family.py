"""The rigid family: inertias, first moments, friction and offsets from records."""

from __future__ import annotations

from robid.later import later
from robid.models.family import Export, Family

with later(__name__):
    from robid.models.rigid.files import mjcf, robot_file, urdf, write_csv, write_json, write_mat
    from robid.models.rigid.fitting import fit, misfits, phrase_of_model, validate, values_in
    from robid.models.rigid.page.report import report
    from robid.models.rigid.settings import RigidFit, model_settings, problems, seed_of

RIGID = Family(
    name="rigid",
    settings=RigidFit,
    reads=("record",),
    problems=problems,
    decides=model_settings,
    fit=fit,
    validate=validate,
    phrase=phrase_of_model,
    report=report,
    exports={
        "robot": Export("robot.yaml", (".yaml", ".yml"), robot_file, takes_configuration=False),
        "urdf": Export("robot.urdf", (".urdf",), urdf, takes_configuration=False),
        "mjcf": Export("robot.xml", (".xml",), mjcf, takes_configuration=False, takes_friction=True),
        "json": Export("parameters.json", (".json",), write_json, takes_configuration=False),
        "csv": Export("parameters.csv", (".csv",), write_csv, takes_configuration=False),
        "mat": Export("model.mat", (".mat",), write_mat, takes_configuration=False),
    },
    seed=seed_of,
    true_values=values_in,
    misfits=misfits,
)

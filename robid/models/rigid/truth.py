"""The true values of a rigid fit's base parameters in a true robot."""

from __future__ import annotations

from robid.models.rigid.settings import loaded_campaign, rigid_fit
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import LoadedExperiment
from robid.simulate.truth import TrueRobot


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every base parameter of the model, by the name of its first standard parameter.

    Parameters that a motion cannot tell apart are regrouped by the fit: these have no value here.
    """
    options = rigid_fit(loaded.experiment, name).options()
    robot = loaded.robot.to_robot(loaded_campaign(loaded, name).payload_kg)
    nominal = build_rigid_model(robot, options.model)
    base = find_base_parameters(nominal, options.base)
    values = base.values(build_rigid_model(true.robot, options.model).nominal)
    return dict(zip(base.base_names, values.tolist(), strict=True))

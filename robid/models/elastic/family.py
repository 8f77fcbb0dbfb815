"""The elastic family: springs and dampers from frequency responses, and what must hold of a fit for a robot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.later import later
from robid.models.elastic.fit.options import name_problems
from robid.models.elastic.settings import ElasticFit, elastic_fit, model_settings
from robid.models.family import Export, Family
from robid.settings.checks.beyond_motors import without_motor_text
from robid.settings.checks.campaigns import TORQUE, missing_limits
from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import kinds_by_name
from robid.settings.yaml import FieldPath

with later(__name__):
    from robid.models.elastic.by_name import free_problems, free_too, names_from_free
    from robid.models.elastic.fitting import (
        fit,
        misfits,
        phrase_of_model,
        refit,
        validate,
        values_in,
        verdict_of_validation,
    )
    from robid.models.elastic.mechanics import write_csv, write_json, write_mat, write_mjcf, write_state_space
    from robid.models.elastic.page.report import compare, report

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with an elastic fit for a robot: names, starts at zero, missing limits."""
    fit = elastic_fit(experiment, name)
    if robot.without_motor:
        told = without_motor_text(robot.without_motor)
        yield ("family",), f"S048 an elastic model has a motor and a transmission at every joint: {told}"
        return
    yield from _arm_torques(experiment, fit)
    known = kinds_by_name(robot, fit.kinds)
    if fit.estimated and robot.is_complete:
        yield from free_problems(experiment, fit, robot)
        known |= names_from_free(experiment, fit, robot)
    for index, parameter in enumerate(fit.fixed):
        if parameter not in known:
            message = f"S049 there is no free parameter `{parameter}`; {suggest(parameter, known)}"
            yield ("fixed", index), message
    free = {name: kind for name, kind in known.items() if name not in fit.fixed}
    for section, problem in name_problems(fit.options(), free):
        yield (section,), problem
    for spring in robot.all_springs:
        parameter = f"{spring.name}.damping"
        damping = spring.value("damping", linear=spring.is_linear(robot.joints))
        if damping == 0 and parameter in known and parameter not in fit.fixed:
            message = (
                f"S050 `{parameter}` is 0 in the robot file, but must start above 0 to be estimated: put it in `fixed`"
            )
            yield ("free",), message
    if "cubic" in fit.kinds and robot.is_complete:
        yield from missing_limits(("free",), "the scale of `cubic` needs", robot, (TORQUE,))


def _arm_torques(experiment: Experiment, fit: ElasticFit) -> _Found:
    """Yields logs whose torques are of the arm side: springs lie between motor and arm."""
    for name in fit.campaigns:
        source = experiment.campaigns[name].source if name in experiment.campaigns else None
        inputs = () if source is None or source.measured is None else source.measured.inputs
        felt = [one.name for one in inputs if one.side == "arm"]
        if felt:
            told = f"the inputs of `{name}` are of the arm side ({', '.join(f'`{one}.arm`' for one in felt)})"
            yield (
                ("from",),
                f"S051 {told}: an elastic model reads torques or currents of motors, which go without `.arm`",
            )


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

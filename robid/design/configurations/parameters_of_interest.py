"""The parameters that a choice of configurations is about, and those that are estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.parameters import LOGARITHMIC, RESPONSE_NUISANCE, element_names, viscous_scale
from robid.robot.response import ElasticParameters


@dataclass(frozen=True)
class ParametersOfInterest:
    """Parameters of a design.

    Attributes:
        kinds: All kinds, those that are estimated along last.
        columns (n_all,): Which elements of these kinds are estimated.
        names: Names of the parameters that the design is about; they come first among those estimated.
        precision (n_estimated,): What is known of each beforehand, over its variance; of those that the design is
            about, nothing.
    """

    kinds: tuple[str, ...]
    columns: BoolArray
    names: tuple[str, ...]
    precision: FloatArray

    def scales(self, nominal: ElasticParameters, period_s: float) -> FloatArray:
        """Scale (n_estimated,) of each: its value, or of a linear nuisance what is natural to it."""
        return natural_scales(nominal, period_s, self.kinds)[self.columns]


def natural_scales(nominal: ElasticParameters, period_s: float, kinds: Sequence[str]) -> FloatArray:
    """Scale (n_all,) of each parameter of some kinds: its value, or of a linear nuisance what is natural to it."""
    natural = {"viscous": viscous_scale(nominal.motor_inertia), "delay": np.array([period_s])}
    natural["arm_viscous"] = viscous_scale(nominal.link_inertia)
    return np.concatenate([natural[kind] if kind in natural else getattr(nominal, kind) for kind in kinds])


def choose_parameters(
    robot: Robot, kinds: Sequence[str], nuisance: Sequence[str], fixed: Sequence[str], prior_decades: float = np.inf
) -> ParametersOfInterest:
    """Chooses the parameters of a design.

    Args:
        robot: Nominal robot.
        kinds: Kinds of parameters that the design is about, of `LOGARITHMIC`.
        nuisance: Kinds that are estimated along, of `LOGARITHMIC` and `RESPONSE_NUISANCE`.
        fixed: Names of single parameters that are known.
        prior_decades: Standard deviation of what the robot file knows of springs, dampers and link inertias that are
            estimated along [decades]; that of motor inertias is the file's own.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.
    """
    wrong = [kind for kind in kinds if kind not in LOGARITHMIC]
    wrong += [kind for kind in nuisance if kind not in (*LOGARITHMIC, *RESPONSE_NUISANCE)]
    if wrong:
        message = f"configurations cannot be designed for {', '.join(wrong)}"
        raise SettingsError(
            message, where="design", remedy=f"choose among {', '.join((*LOGARITHMIC, *RESPONSE_NUISANCE))}"
        )
    if twice := set(kinds) & set(nuisance):
        message = f"{', '.join(sorted(twice))} cannot be both wanted and a nuisance"
        raise SettingsError(message, where="design", remedy="name each kind once")
    every = (*dict.fromkeys(kinds), *dict.fromkeys(nuisance))
    pairs = [(kind, name) for kind in every for name in element_names(robot, kind) if name is not None]
    unknown = [name for name in fixed if name not in {known for _, known in pairs}]
    if unknown:
        message = f"`fixed` names {', '.join(unknown)}, which nothing estimates"
        raise SettingsError(message, where="design.fixed", remedy="correct `fixed`, or the kinds of parameters")
    columns = np.array([name not in fixed for _, name in pairs])
    known = {f"{joint.name}.motor_inertia": joint.motor.inertia_relative_std for joint in robot.joints}
    known |= {name: np.log(10) * prior_decades for kind, name in pairs if kind in LOGARITHMIC and name not in known}
    deviation = [np.inf if kind in kinds else known.get(name, np.inf) for kind, name in pairs]
    names = tuple(name for kind, name in pairs if kind in kinds and name not in fixed)
    return ParametersOfInterest(every, columns, names, 1 / np.array(deviation)[columns] ** 2)


def eliminated(matrices: Sequence[FloatArray], precision: FloatArray, count: int) -> list[FloatArray]:
    """Takes out what is estimated along.

    Args:
        matrices (n_all, n_all): Information, and further matrices that follow the same elimination.
        precision (n_all,): What is known beforehand.
        count: Number of parameters that stay.

    Returns:
        Matrices (count, count) with the nuisances at their best for the first matrix, prior precision included.
    """
    whole = [matrix + np.diag(precision) for matrix in matrices]
    nuisance, mixed = whole[0][count:, count:], whole[0][count:, :count]
    # In units of each nuisance's own effect: seconds and newton metres differ by many decades.
    scale = np.sqrt(np.where(np.diag(nuisance) > 0, np.diag(nuisance), 1.0))
    inverse = np.linalg.pinv(nuisance / (scale[:, None] * scale), rcond=1e-13, hermitian=True)
    follow = np.vstack([np.eye(count), -(inverse @ (mixed / scale[:, None])) / scale[:, None]])
    return [follow.T @ matrix @ follow for matrix in whole]

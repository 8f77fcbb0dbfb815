"""The parameters that a choice is about, what candidates tell of them under assumed noise, and what a visit costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, check_shape
from robid.design.configurations.options import ALONG
from robid.errors import SettingsError
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import FREE, LOGARITHMIC, OF_SPRINGS, RESPONSE_NUISANCE, element_names, viscous_scale
from robid.robot.response import ElasticParameters, nominal_parameters, response

_ROUNDING = 1e-12


@dataclass(frozen=True)
class ParametersOfInterest:
    """Parameters of a design."""

    kinds: tuple[str, ...]  # All kinds, those that are estimated along last
    columns: BoolArray  # (n_all,) Which elements of these kinds are estimated
    names: tuple[str, ...]  # Names of the parameters that the design is about; they come first among those estimated
    # (n_estimated,) What is known of each beforehand, over its variance; of those that the design is about, nothing
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
    known_kinds = (*LOGARITHMIC, *RESPONSE_NUISANCE)
    wrong = [kind for kind in kinds if kind not in LOGARITHMIC] + [kind for kind in nuisance if kind not in known_kinds]
    if wrong:
        message, remedy = f"S020 configurations cannot be designed for {', '.join(wrong)}", ", ".join(known_kinds)
        raise SettingsError(message, where="design", remedy=f"choose among {remedy}")
    if twice := set(kinds) & set(nuisance):
        message = f"S021 {', '.join(sorted(twice))} cannot be both wanted and a nuisance"
        raise SettingsError(message, where="design", remedy="name each kind once")
    every = (*dict.fromkeys(kinds), *dict.fromkeys(nuisance))
    pairs = [(kind, name) for kind in every for name in element_names(robot, kind) if name is not None]
    unknown = [name for name in fixed if name not in {known for _, known in pairs}]
    if unknown:
        message = f"S022 `fixed` names {', '.join(unknown)}, which nothing estimates"
        raise SettingsError(message, where="design.fixed", remedy="correct `fixed`, or the kinds of parameters")
    columns = np.array([name not in fixed for _, name in pairs])
    known = {f"{joint.name}.motor_inertia": joint.motor.inertia_relative_std for joint in robot.joints}
    # A standard deviation in decades is log(10) times as large in natural logarithms.
    known |= {name: np.log(10) * prior_decades for kind, name in pairs if kind in LOGARITHMIC and name not in known}
    deviation = [np.inf if kind in kinds else known.get(name, np.inf) for kind, name in pairs]
    names = tuple(name for kind, name in pairs if kind in kinds and name not in fixed)
    return ParametersOfInterest(every, columns, names, 1 / np.array(deviation)[columns] ** 2)


def eliminated(matrices: Sequence[FloatArray], precision: FloatArray, count: int) -> list[FloatArray]:
    """Takes out what is estimated along: matrices (count, count) of the first parameters, prior precision included.

    Matrices (n_all, n_all) are the information, and further ones that follow its elimination; the precision (n_all,) is
    what is known beforehand.
    """
    whole = [matrix + np.diag(precision) for matrix in matrices]
    nuisance, mixed = whole[0][count:, count:], whole[0][count:, :count]
    # In units of each nuisance's own effect: seconds and newton metres differ by many decades.
    scale = np.sqrt(np.where(np.diag(nuisance) > 0, np.diag(nuisance), 1.0))
    inverse = np.linalg.pinv(nuisance / (scale[:, None] * scale), rcond=1e-13, hermitian=True)
    # Schur complement as [I; -K]' H [I; -K] with K = H_nn^-1 H_nw; further matrices follow the same K.
    follow = np.vstack([np.eye(count), -(inverse @ (mixed / scale[:, None])) / scale[:, None]])
    return [follow.T @ matrix @ follow for matrix in whole]


KINDS = (*OF_SPRINGS, *(kind for kind in RESPONSE_NUISANCE if kind in FREE))
"""Kinds of parameters that an excitation is shaped for; the last two are nuisance."""


def candidate_information(
    robot: Robot,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    sampling_period_s: float,
    delay_s: float,
    relative_error: float,
    *,
    kinds: Sequence[str] = OF_SPRINGS,
    nuisance: Sequence[str] = ALONG,
    fixed: Sequence[str] = (),
    weights: FloatArray | None = None,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Information (n_conf, n_param, n_param) about log-parameters, nuisances eliminated in each, and their names.

    What the robot file knows of motor inertias that are estimated along counts in each.

    Args:
        robot: Nominal robot.
        configurations (n_conf, n_joint): Candidates [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
        sampling_period_s: Sampling period [s].
        delay_s: Delay from recorded to applied torque [s].
        relative_error: Assumed relative standard deviation of each response element.
        kinds: Kinds of parameters that the design is about.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        weights (n_freq, n_out, n_in): Design weights, 1 for full importance.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.

    Source:
        Zimmermann et al. (2023), eq. 4-5 with `Lambda = relative_error^2` of the log response.
    """
    wanted = choose_parameters(robot, kinds, nuisance, fixed)
    relative = relative_derivatives(robot, configurations, frequency_hz, sampling_period_s, delay_s, wanted)
    if weights is not None:
        relative = relative * np.sqrt(weights)[..., None]
    rows = relative.reshape(len(configurations), -1, relative.shape[-1]) / relative_error
    # Complex residuals have two real parts of half the variance each: 2 Re(J^H J).
    information = 2 * np.real(rows.conj().swapaxes(1, 2) @ rows)
    matrices = [eliminated([each], wanted.precision, len(wanted.names))[0] for each in information]
    return np.array(matrices), wanted.names


def relative_derivatives(
    robot: Robot,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    sampling_period_s: float,
    delay_s: float,
    wanted: ParametersOfInterest,
    outputs: tuple[str, ...] | None = None,
) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_estimated) of the log response by log-parameters and nuisances.

    Outputs are the motors' accelerations when not named.
    """
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations), outputs)
    nominal = nominal_parameters(robot, linear, delay_s)
    result = response(linear, nominal, frequency_hz, sampling_period_s)
    plain = jacobian(linear, nominal, result, wanted.kinds)[..., wanted.columns]
    # d log G / d log p = p (dG / dp) / G: information about log-parameters (Zimmermann et al. 2023, eq. 4).
    scaled = plain * wanted.scales(nominal, sampling_period_s)
    # Joints that do not move each other, as lift and elbow of a SCARA, have an element of nothing but rounding.
    size = np.abs(result.sampled)
    is_there = size > _ROUNDING * size.max(axis=(-2, -1), keepdims=True)
    where = np.broadcast_to(is_there[..., None], scaled.shape)
    return np.asarray(np.divide(scaled, result.sampled[..., None], out=np.zeros_like(scaled), where=where))


def visit_cost_s(robot: Robot, configurations: FloatArray, measuring_s: float, speed_share: float) -> FloatArray:
    """Time (n_conf,) that a visit takes: the experiments there and the way from the first configuration [s].

    All joints travel together; the one that needs longest at its share of the motor's largest speed decides. The first
    configuration (n_conf, n_joint) [rad] stands for wherever the robot comes from: the order of the visits is not known
    yet. The experiments of one visit take `measuring_s` [s].
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(robot.joints))
    speed = np.array([joint.motor.max_speed_rad_s / abs(joint.motor.gear_ratio) for joint in robot.joints])
    # Joints travel together: the slowest one decides.
    way = np.abs(configurations - configurations[0]) / (speed_share * speed)
    return np.asarray(measuring_s + way.max(axis=1))

"""Torque laws of several configurations as one, with what no law of the family explains in their deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.robot.friction import TorqueLaw, with_level

_MIN_EXPLAINED = 0.5
_SIGNIFICANT = 2.0  # friction as strong as the noise


@dataclass(frozen=True)
class LawEstimate:
    """Torque laws of all motors as one configuration shows them."""

    values: FloatArray  # (n_in, 7) The laws' coordinates, in the order of `robid.robot.friction.COORDINATES`
    covariance: FloatArray  # (n_in, 7, 7) Their covariance, robust against errors that all experiments share at a line
    form_deviation: FloatArray  # (n_in, 7) Their deviations if all that the law leaves were the error of its form
    explained: FloatArray  # (n_in,) Share of the silent lines' torque above noise that the law explains
    significance: FloatArray  # (n_in,) Silent lines' torque power over that of noise; infinite without a noise estimate
    form_share: FloatArray  # (n_in,) Share of what the law leaves there that is not noise: the error of the law's form
    torque_peak: FloatArray  # (n_in,) Largest torque that was measured, its mean taken off


def combine_laws(
    estimates: Sequence[LawEstimate], start: Sequence[TorqueLaw], stated: Sequence[TorqueLaw], names: Sequence[str]
) -> tuple[tuple[TorqueLaw, ...], tuple[str, ...]]:
    """Joins the estimates of several configurations to one law per motor.

    What a law leaves beyond noise is the error of its form, alike in every configuration and at all lines: that share
    of the variance falls with neither number. The estimates' scatter counts where it is larger.

    Args:
        estimates: One per configuration, all started from the same laws.
        start: The laws they started from.
        stated: The laws of the robot file.
        names: Names of the motors.

    Returns:
        The laws with their deviations and their distance from the robot file's, and notes.

    Raises:
        DataError: If a law explains too little of what the silent lines show, or its level is above all torque that
            ever moved the motor.
    """
    significant = np.median([estimate.significance for estimate in estimates], axis=0) > _SIGNIFICANT
    _refuse_poor(np.median([estimate.explained for estimate in estimates], axis=0), significant, names)
    combined, notes = [], []
    for motor, law in enumerate(start):
        if significant[motor]:
            combined.append(_distance(_combine(estimates, motor, law), stated[motor]))
        else:
            combined.append(law.silenced())
            notes.append(f"Motor {names[motor]}: the silent lines show noise only, nothing was compensated.")
    _refuse_absurd(combined, np.max([estimate.torque_peak for estimate in estimates], axis=0), names)
    return tuple(combined), tuple(notes)


def _refuse_poor(explained: FloatArray, significant: BoolArray, names: Sequence[str]) -> None:
    poor = significant & (explained < _MIN_EXPLAINED)
    if poor.any():
        shares = zip(names, explained, poor, strict=True)
        worst = ", ".join(f"{name} ({100 * share:.0f} %)" for name, share, is_poor in shares if is_poor)
        raise DataError(
            f"D019 friction and ripple explain too little of the torque at the silent lines: {worst}",
            where="compensation: silent_lines",
            remedy="use `compensation: nominal` or `none`; look for saturation, backlash or a wrong delay",
        )


def _refuse_absurd(laws: Sequence[TorqueLaw], peak: FloatArray, names: Sequence[str]) -> None:
    """A motor that moves has overcome its friction: a level above its largest torque was not seen, but extrapolated."""
    absurd = [
        f"{name} ({law.coulomb_nm:.3g}, the largest torque is {most:.3g})"
        for name, law, most in zip(names, laws, peak, strict=True)
        if not law.coulomb_nm <= most
    ]
    if absurd:
        raise DataError(
            f"D020 friction at the silent lines would need more than the motor's whole torque: {', '.join(absurd)}",
            where="compensation: silent_lines",
            remedy="raise the excitation until the motors slide, or use `compensation: nominal` or `none`",
        )


def _combine(estimates: Sequence[LawEstimate], motor: int, law: TorqueLaw) -> TorqueLaw:
    values = np.array([estimate.values[motor] for estimate in estimates])
    # Weighted mean by the inverse covariances, and the scatter about it over its expectation.
    information = np.linalg.inv([estimate.covariance[motor] for estimate in estimates])
    covariance = np.linalg.inv(information.sum(axis=0))
    mean = covariance @ np.einsum("cij,cj->i", information, values)
    scatter = np.einsum("ci,cij,cj->", values - mean, information, values - mean)
    freedom = (len(values) - 1) * len(mean)
    share = float(np.mean([estimate.form_share[motor] for estimate in estimates]))
    form = np.mean([estimate.form_deviation[motor] ** 2 for estimate in estimates], axis=0)
    scattered = np.diag(covariance) * (scatter / freedom if freedom else 1.0)
    # The share that is an error of form does not average out over configurations; the rest does.
    deviation = np.sqrt(np.maximum((1 - share) * np.diag(covariance) + share * form, scattered))
    return law.at(mean).deviating(deviation)


def _distance(law: TorqueLaw, stated: TorqueLaw) -> TorqueLaw:
    """The law with its distance from the robot file's, where that has friction of the same kind."""
    ripple = (law.ripple_sin - stated.ripple_sin, law.ripple_cos - stated.ripple_cos)
    if stated.coulomb_nm == 0 or stated.law != law.law:
        return replace(law, offset=(0.0, 0.0, 0.0, *ripple))
    relative = (law.coulomb_nm / stated.coulomb_nm - 1, law.width / stated.width - 1)
    return replace(law, offset=(*relative, law.lag_samples - stated.lag_samples, *ripple))


def with_levels(
    stated: Sequence[TorqueLaw], level: FloatArray, std: FloatArray, uneven: FloatArray
) -> tuple[TorqueLaw, ...]:
    """Laws with Coulomb levels that are known from elsewhere, of the robot file's shape.

    A level that differs between the directions is their mean: the rest is a constant torque, which no line shows.

    Args:
        stated: The laws of the robot file; breakaway keeps its ratio to the Coulomb level.
        level (n_in,): Coulomb levels [N m].
        std (n_in,): Their standard deviations [N m].
        uneven (n_in,): Half of what viscous friction is larger forward than backward [N m s/rad].
    """
    found = []
    for law, own, deviation, more in zip(stated, np.maximum(level, 0.0).tolist(), std.tolist(), uneven, strict=True):
        shape = (law.relative_std * law.stribeck_rad_s, law.relative_std * law.width)
        # Lag and ripple are as little known as the robot file's.
        changed = replace(with_level(law, own), uneven_nms_rad=float(more))
        others = changed.coefficient_std[2:]
        identified = (deviation, with_level(law, deviation).static_nm, *shape, *others)
        found.append(_distance(replace(changed, identified_std=identified), law))
    return tuple(found)

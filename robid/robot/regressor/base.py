"""Base parameters of a rigid model, by a pivoted QR of its columns on random motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular

from robid.arrays import FloatArray, IntArray, check_shape
from robid.robot.regressor.drives import BaseOptions
from robid.robot.regressor.model import RigidModel

_TIDY = 1e-7  # a smaller share of a column is rounding
_SILENT = 1e-12  # a column this much smaller than the largest one does nothing
_ANY_TURN = np.pi  # range of joints without limits [rad, or m]
_LATE = (".YY", ".MZ", ".M")


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters as combinations of standard parameters."""

    names: tuple[str, ...]  # (n_std) Names of the standard parameters
    # (n_base,) Indices of the columns that stand for the base parameters, ascending: the regressor's columns of these
    # times the base parameters is the torque
    columns: IntArray
    combination: FloatArray  # (n_base, n_std) The base parameters are `combination @ standard`
    labels: tuple[str, ...]  # (n_base) Each as its combination, such as `joint_1.ZZ + joint_2.YY + 0.81 joint_2.M`
    units: tuple[str, ...]  # (n_base) Units of the base parameters, those of their columns
    silent: tuple[str, ...]  # Names of standard parameters without any effect
    undetermined: tuple[str, ...]  # Names of those that are known only together with others
    singular_values: FloatArray  # (n_std,) Of the regressor with columns scaled to 1, descending
    gap: float  # Smallest singular value that counts over the largest one that does not; infinite where that is zero

    @property
    def base_names(self) -> tuple[str, ...]:
        """Names (n_base) of the standard parameters that stand for the base parameters."""
        return tuple(self.names[index] for index in self.columns)

    def values(self, standard: FloatArray) -> FloatArray:
        """Returns the base parameters (n_base,) of standard parameters (n_std,)."""
        return np.asarray(self.combination @ standard)


def find_base_parameters(model: RigidModel, options: BaseOptions | None = None) -> BaseParameters:
    """Finds the base parameters of a rigid model from random configurations within its joint limits.

    Args:
        model: The model; a payload of its own is there in half of the configurations.
        options: How they are found.

    Source:
        Gautier (1991), numerical calculation of the base inertial parameters.
    """
    chosen = options or BaseOptions()
    columns = random_columns(model, chosen)
    # Joints over their typical torque: else the largest one would decide what is dependent.
    size = np.sqrt((columns**2).mean(axis=(0, 2), keepdims=True))
    rows = (columns / np.where(size > 0, size, 1.0)).reshape(-1, len(model.names))
    return select_base(rows, model, chosen.threshold)


def random_columns(model: RigidModel, options: BaseOptions) -> FloatArray:
    """Returns the regressor (n_sample, n_joint, n_std) at random positions, speeds and accelerations.

    The friction's load, where it is asked for, is random too.
    """
    generator, robot = np.random.default_rng(options.seed), model.robot
    shape = (options.n_sample, len(robot.joints))
    lower = np.where(np.isfinite(robot.lower), robot.lower, -_ANY_TURN)
    upper = np.where(np.isfinite(robot.upper), robot.upper, _ANY_TURN)
    to_motor = robot.motor_per_arm.T
    position = generator.uniform(lower, upper, shape) @ to_motor
    velocity = options.speed_rad_s * generator.uniform(-1, 1, shape) @ to_motor
    acceleration = options.acceleration_rad_s2 * generator.uniform(-1, 1, shape) @ to_motor
    torque = generator.standard_normal(shape)
    half = options.n_sample // 2
    parts = [
        model.columns(position[rows], velocity[rows], acceleration[rows], torque=torque[rows], loaded=loaded)
        for rows, loaded in ((slice(half), False), (slice(half, None), True))
    ]
    return np.concatenate(parts)


def select_base(factor: FloatArray, model: RigidModel, threshold: float = BaseOptions.threshold) -> BaseParameters:
    """Finds the base parameters that a regressor or a factor of its information shows.

    Columns are scaled to 1. Those by which a base parameter is best known to the field are offered first, each
    group to a pivoted QR of what the groups before left: friction, offsets and counterbalances; inertias about the
    joints' own axes and masses along them; motor inertias; what else links have, but for YY, MZ and M, which come last.

    Args:
        factor (n_row, n_std): A regressor `W`, or any factor with `factor^T factor = W^T W`, such as its R.
        model: What the columns are.
        threshold: Distance, over its own length, at which a column is dependent on others.

    Source:
        Gautier (1991); docs/methods, sec. 7.
    """
    check_shape("factor", factor, "n_row n_std", n_std=len(model.names))
    length = np.linalg.norm(factor, axis=0)
    silent = length <= _SILENT * length.max()
    scale = np.where(silent, 1.0, length)
    scaled = np.where(silent, 0.0, factor / scale)
    if len(scaled) > scaled.shape[1]:
        # Only R matters: Q does not change which columns depend on others, nor singular values.
        scaled = np.asarray(qr(scaled, mode="r")[0][: scaled.shape[1]])
    kept = np.sort(_independent(scaled, _preference(model), threshold))
    singular = np.linalg.svd(scaled, compute_uv=False)
    # W x = W_b (x_b + C x_d) with W_d = W_b C; scales of the columns are taken back.
    combination = _combination(scaled, kept) * scale[None] / scale[kept, None]
    others = np.setdiff1d(np.flatnonzero(np.abs(combination).sum(axis=0) > 0), kept)
    return BaseParameters(
        names=model.names,
        columns=kept,
        combination=combination,
        labels=tuple(label(row, model.names, own) for row, own in zip(combination, kept.tolist(), strict=True)),
        units=tuple(model.units[index] for index in kept),
        silent=tuple(name for name, is_silent in zip(model.names, silent, strict=True) if is_silent),
        undetermined=tuple(model.names[index] for index in _mixed(combination, kept, others)),
        singular_values=singular,
        gap=_gap(singular, kept.size),
    )


def label(row: FloatArray, names: Sequence[str], first: int) -> str:
    """Writes a combination (n_std,) of parameters, one of them first, coefficients to four digits."""
    order = [first, *(int(index) for index in np.flatnonzero(row) if index != first)]
    text = ""
    for index in order:
        # Rounded twice, so that rounding of the last digits does not decide between 1.322 and 1.323.
        size = f"{float(f'{abs(row[index]):.8g}'):.4g}"
        term = names[index] if size == "1" else f"{size} {names[index]}"
        sign = "-" if row[index] < 0 else "+"
        text += f" {sign} {term}" if text else (f"-{term}" if sign == "-" else term)
    return text


def _preference(model: RigidModel) -> IntArray:
    """Group (n_std,) in which each column is offered, 0 first; the chain's links come before what hangs on them."""
    slides = {joint.name: joint.type == "prismatic" for joint in model.robot.joints}
    groups = []
    for name, kind in zip(model.names, model.kinds, strict=True):
        owner = name.rpartition(".")[0]
        if kind == "motor_inertia":
            groups.append(4)
        elif kind not in ("inertia", "first_moment", "mass"):
            groups.append(0)
        elif name == f"{owner}.{'M' if slides.get(owner) else 'ZZ'}":
            groups.append(2 if owner in slides else 3)
        else:
            groups.append((7 if name.endswith(_LATE) else 5) + (owner not in slides))
    return np.array(groups)


def _independent(scaled: FloatArray, groups: IntArray, threshold: float) -> IntArray:
    """Indices of columns that span all others, chosen group by group."""
    rest, kept = scaled.copy(), np.zeros(0, int)
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        # Pivoted QR: the diagonal falls, and what is below the threshold is dependent on what came before.
        triangle, order = qr(rest[:, members], mode="r", pivoting=True)
        count = int((np.abs(np.diag(triangle)) > threshold).sum())
        kept = np.concatenate([kept, members[order[:count]]])
        basis = np.linalg.qr(scaled[:, kept])[0]
        # What is left of all other columns outside the span of those kept (Gram and Schmidt by projection).
        rest = scaled - basis @ (basis.T @ scaled)
    return kept


def _combination(scaled: FloatArray, kept: IntArray) -> FloatArray:
    """Scaled columns as combinations of those kept (n_base, n_std), rounding removed."""
    basis, triangle = np.linalg.qr(scaled[:, kept])
    # Coefficients of all columns in those kept, R c = Q' w.
    found = np.asarray(solve_triangular(triangle, basis.T @ scaled))
    found[np.abs(found) < _TIDY] = 0.0
    found[:, kept] = np.eye(kept.size)
    return found


def _mixed(combination: FloatArray, kept: IntArray, others: IntArray) -> IntArray:
    """Columns whose parameters appear only together with others."""
    shared = kept[(combination[:, others] != 0).any(axis=1)]
    return np.sort(np.concatenate([shared, others]))


def _gap(singular: FloatArray, n_base: int) -> float:
    if n_base == 0 or n_base >= singular.size or singular[n_base] == 0:
        return float("inf")
    return float(singular[n_base - 1] / singular[n_base])

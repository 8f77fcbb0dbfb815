"""Which parameters are estimated, and their map to the optimizer's internal values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.errors import SettingsError
from robid.fit.options import ElasticOptions
from robid.robot.description import Robot
from robid.robot.response import ElasticParameters, with_values

LOGARITHMIC = ("stiffness", "damping", "motor_inertia", "link_inertia")
_UNITS = {
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "viscous": "N m s/rad",
    "motor_inertia": "kg m^2",
    "link_inertia": "kg m^2",
    "delay": "s",
    "friction": "1",
}
_VISCOUS_SCALE_HZ = 1.0


@dataclass(frozen=True)
class ParameterMap:
    """Internal parameters `x`: `value = nominal exp(x)` or `value = nominal + scale x`.

    Friction scales, the distances of the compensated friction from the robot file's, come last; their internal
    value is the distance from what was compensated.

    Attributes:
        nominal: Values of the robot file.
        kinds: Kinds that are estimated, in order.
        masks: Estimated elements of each kind.
        names: Name of each internal parameter.
        kind_of: Kind of each internal parameter.
        logarithmic (n_param,): Which internal parameters are logarithmic.
        scale (n_param,): Scale of the linear ones, 1 for the others.
        prior_std (n_param,): Standard deviation known beforehand; infinite where nothing is known.
        friction_offset (n_friction,): Friction scales as they were compensated.
    """

    nominal: ElasticParameters
    kinds: tuple[str, ...]
    masks: tuple[BoolArray, ...]
    names: tuple[str, ...]
    kind_of: tuple[str, ...]
    logarithmic: BoolArray
    scale: FloatArray
    prior_std: FloatArray
    friction_offset: FloatArray

    @property
    def n_friction(self) -> int:
        """Number of friction scales."""
        return self.kind_of.count("friction")

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter."""
        named = zip(self.names, self.kind_of, strict=True)
        return tuple("samples" if name.endswith(".lag") else _UNITS[kind] for name, kind in named)

    def nominal_values(self) -> FloatArray:
        """Nominal value (n_param,) of each parameter in its own unit."""
        parts = [getattr(self.nominal, kind)[mask] for kind, mask in zip(self.kinds, self.masks, strict=True)]
        return np.concatenate([*parts, self.friction_offset])

    def values(self, internal: FloatArray) -> FloatArray:
        """Values (n_param,) in their own units."""
        nominal = self.nominal_values()
        return np.where(
            self.logarithmic, nominal * np.exp(internal * self.logarithmic), nominal + self.scale * internal
        )

    def slopes(self, internal: FloatArray) -> FloatArray:
        """Derivative (n_param,) of each value with respect to its internal parameter."""
        return np.where(self.logarithmic, self.values(internal), self.scale)

    def parameters(self, internal: FloatArray) -> ElasticParameters:
        """Returns all parameter values, fixed ones at nominal."""
        values, result, begin = self.values(internal), self.nominal, 0
        for kind, mask in zip(self.kinds, self.masks, strict=True):
            full = getattr(self.nominal, kind).copy()
            count = int(mask.sum())
            full[mask] = values[begin : begin + count]
            result, begin = with_values(result, kind, full), begin + count
        return result

    def columns(self) -> IntArray:
        """Indices of the estimated elements among all elements of the estimated kinds."""
        return np.flatnonzero(np.concatenate(self.masks))


def map_parameters(
    robot: Robot,
    nominal: ElasticParameters,
    options: ElasticOptions,
    friction_names: tuple[str, ...],
    friction_std: FloatArray,
    friction_offset: FloatArray | None = None,
) -> ParameterMap:
    """Selects the estimated parameters.

    Args:
        robot: The robot, for names.
        nominal: Nominal values.
        options: Kinds that are free, single names that are fixed.
        friction_names: Names of the compensated friction coefficients.
        friction_std (n_friction,): Their relative standard deviations.
        friction_offset (n_friction,): Their values as they were compensated; None for zero.

    Raises:
        SettingsError: If a fixed name is unknown or a logarithmic parameter's nominal value is not positive.
    """
    springs = [spring.name for spring in robot.springs]
    joints = [joint.name for joint in robot.joints]
    kinds: tuple[str, ...] = tuple(dict.fromkeys(options.free))
    every = {
        kind: ["delay"]
        if kind == "delay"
        else [f"{n}.{kind}" for n in (springs if kind in LOGARITHMIC[:2] else joints)]
        for kind in kinds
    }
    _check_names(options, {name for names in every.values() for name in names}, every, nominal)
    masks = tuple(np.array([name not in options.fixed for name in every[kind]]) for kind in kinds)
    names = [
        name
        for kind, mask in zip(kinds, masks, strict=True)
        for name, free in zip(every[kind], mask, strict=True)
        if free
    ]
    kind_of = [kind for kind, mask in zip(kinds, masks, strict=True) for _ in range(int(mask.sum()))]
    scales = {"viscous": 2 * np.pi * _VISCOUS_SCALE_HZ * nominal.motor_inertia, "delay": np.array([1e-3])}
    scale = [
        scales[kind][mask] if kind in scales else np.ones(int(mask.sum()))
        for kind, mask in zip(kinds, masks, strict=True)
    ]
    n_friction = len(friction_names)
    decades = np.log(10) * options.prior_decades
    prior = np.array([decades if kind in LOGARITHMIC else np.inf for kind in kind_of])
    return ParameterMap(
        nominal=nominal,
        kinds=kinds,
        masks=masks,
        names=(*names, *friction_names),
        kind_of=(*kind_of, *["friction"] * n_friction),
        logarithmic=np.array([kind in LOGARITHMIC for kind in kind_of] + [False] * n_friction),
        scale=np.concatenate([*scale, np.ones(n_friction)]),
        prior_std=np.concatenate([prior, friction_std]),
        friction_offset=np.zeros(n_friction) if friction_offset is None else friction_offset,
    )


def _check_names(
    options: ElasticOptions, known: set[str], every: dict[str, list[str]], nominal: ElasticParameters
) -> None:
    problems = [f"`fixed` names `{name}`, which is not free (free: {', '.join(sorted(known))})"
                for name in options.fixed if name not in known]  # fmt: skip
    for kind, names in every.items():
        if kind in LOGARITHMIC:
            values = getattr(nominal, kind)
            problems += [
                f"`{name}` starts at {value:g}, but must be positive to be estimated"
                for name, value in zip(names, values, strict=True)
                if value <= 0 and name not in options.fixed
            ]
    if problems:
        raise SettingsError("; ".join(problems), where="fit", remedy="correct `fixed` or the robot file's values")

"""Which parameters are estimated, and their map to the optimizer's internal values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import SettingsError
from robid.models.elastic.fit.nuisance.effects import Nuisance
from robid.models.elastic.fit.nuisance.kinds import HYSTERESIS, PRIOR_FACTOR
from robid.models.elastic.fit.nuisance.listing import estimated_nuisances
from robid.models.elastic.fit.nuisance.wording import unknown_names
from robid.models.elastic.fit.options import ElasticOptions, check_names, estimable_names
from robid.robot.description import Robot
from robid.robot.parameters import (
    FRICTION_KIND,
    LOGARITHMIC,
    NUISANCE_KIND,
    PARAMETER_KINDS,
    coefficient_unit,
    element_units,
    viscous_scale,
)
from robid.robot.response import ElasticParameters, with_values

_LOCATION_SCALE_M = 0.1
_MOST_DECADES = 30.0
_NOT_ALL = 0.95  # of a mass that a nuisance may take away


@dataclass(frozen=True)
class ParameterMap:
    """Internal parameters `x`: `value = nominal exp(x)` or `value = nominal + scale x`.

    An element is one number of `ElasticParameters`; tied elements share the internal parameter of their leader,
    whose name it bears. Friction scales, the distances of the compensated friction from the robot file's, come
    last; their internal value is the distance from what was compensated.
    """

    nominal: ElasticParameters  # Values of the robot file
    kinds: tuple[str, ...]  # Kinds that are estimated, in order
    masks: tuple[BoolArray, ...]  # Estimated elements of each kind
    elements: tuple[str, ...]  # Name of each estimated element
    member: IntArray  # (n_element,) Internal parameter of each
    element_scale: FloatArray  # (n_element,) Its scale where it is linear, 1 for the others
    names: tuple[str, ...]  # Name of each internal parameter
    kind_of: tuple[str, ...]  # Kind of each internal parameter
    units: tuple[str, ...]  # Unit of each
    logarithmic: BoolArray  # (n_param,) Which internal parameters are logarithmic
    prior_std: FloatArray  # (n_param,) Standard deviation known beforehand; infinite where nothing is known
    lower: FloatArray  # (n_param,) Lower bounds, minus infinity where there is none
    upper: FloatArray  # (n_param,) Upper bounds
    # (n_friction,) Friction scales as they were compensated
    friction_offset: FloatArray = field(default_factory=lambda: np.zeros(0))
    # (n_param,) What the robot file says of each nuisance, to which its amount adds; zero for the others
    stated: FloatArray | None = None
    natural: FloatArray | None = None  # (n_param,) Amount from which each nuisance matters; one for the others
    # Internal deviation of cubic coefficients that only the robot file states, from which they matter
    cubic_std: float = np.inf

    @property
    def n_friction(self) -> int:
        """Number of friction scales."""
        return self.kind_of.count(FRICTION_KIND)

    @property
    def leaders(self) -> IntArray:
        """Element (n_param - n_friction,) that each internal parameter is named after."""
        return np.array([self.elements.index(name) for name in self.names[: len(self.names) - self.n_friction]], int)

    @property
    def tied(self) -> dict[str, str]:
        """Leader of each tied element, by name."""
        pairs = zip(self.elements, self.member.tolist(), strict=True)
        return {name: self.names[index] for name, index in pairs if name != self.names[index]}

    @property
    def scale(self) -> FloatArray:
        """Scale (n_param,) of each linear internal parameter, 1 for the others."""
        return np.concatenate([self.element_scale[self.leaders], np.ones(self.n_friction)])

    def nominal_values(self) -> FloatArray:
        """Nominal value (n_param,) of each parameter in its own unit."""
        own = np.concatenate([self._nominal_elements()[self.leaders], self.friction_offset])
        return own if self.stated is None else own + self.stated

    def values(self, internal: FloatArray) -> FloatArray:
        """Values (n_param,) in their own units; infinite where an interval's end is beyond all numbers."""
        nominal = self.nominal_values()
        with np.errstate(over="ignore"):
            factor = np.exp(internal * self.logarithmic)
            return np.where(self.logarithmic, nominal * factor, nominal + self.scale * internal)

    def slopes(self, internal: FloatArray) -> FloatArray:
        """Derivative (n_param,) of each value with respect to its internal parameter."""
        return np.where(self.logarithmic, self.values(internal), self.scale)

    def element_values(self, internal: FloatArray) -> FloatArray:
        """Values (n_element,) of all estimated elements."""
        nominal, logarithmic, own = self._nominal_elements(), self.logarithmic[self.member], internal[self.member]
        with np.errstate(over="ignore"):
            return np.where(logarithmic, nominal * np.exp(own * logarithmic), nominal + self.element_scale * own)

    def chain(self, internal: FloatArray) -> FloatArray:
        """Derivative (n_element + n_friction, n_param) of all elements, then friction scales, by internal values."""
        n_element, n_friction = self.member.size, self.n_friction
        derivative = np.zeros((n_element + n_friction, len(self.names)))
        # Tied elements share a column, that of their leader.
        derivative[np.arange(n_element), self.member] = self._slopes(internal)
        derivative[n_element:, len(self.names) - n_friction :] = np.eye(n_friction)
        return derivative

    def chained(self, by_kind: ComplexArray, internal: FloatArray) -> ComplexArray:
        """Derivatives (..., n_param - n_friction) by internal values, from those by all elements of the kinds.

        What is given may be overwritten.
        """
        count, mask = len(self.names) - self.n_friction, np.concatenate(self.masks)
        by_element = by_kind if mask.all() else by_kind[..., mask]
        if np.array_equal(self.member, np.arange(count)):  # nothing is tied: each element is a parameter
            by_element *= self._slopes(internal)
            return by_element
        return np.asarray(by_element @ self.chain(internal)[: self.member.size, :count])

    def _slopes(self, internal: FloatArray) -> FloatArray:
        """Derivative (n_element,) of each element by its parameter: that of an exponential is the value itself."""
        return np.where(self.logarithmic[self.member], self.element_values(internal), self.element_scale)

    def parameters(self, internal: FloatArray) -> ElasticParameters:
        """Returns all parameter values, fixed ones at nominal."""
        values, result, begin = self.element_values(internal), self.nominal, 0
        for kind, mask in zip(self.kinds, self.masks, strict=True):
            full = getattr(self.nominal, kind).copy()
            count = int(mask.sum())
            full[mask] = values[begin : begin + count]
            result, begin = with_values(result, kind, full), begin + count
        return result

    def columns(self) -> IntArray:
        """Indices of the estimated elements among all elements of the estimated kinds."""
        return np.flatnonzero(np.concatenate(self.masks))

    def at_bound(self, internal: FloatArray) -> tuple[str, ...]:
        """Names of the parameters that lie at one of their bounds."""
        at = (internal <= self.lower) | (internal >= self.upper)
        return tuple(name for name, there in zip(self.names, at, strict=True) if there)

    def _nominal_elements(self) -> FloatArray:
        parts = [getattr(self.nominal, kind)[mask] for kind, mask in zip(self.kinds, self.masks, strict=True)]
        return np.concatenate(parts)


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
        options: Kinds that are free, single names that are fixed, tied or bounded.
        friction_names: Names of the compensated friction coefficients.
        friction_std (n_friction,): Their relative standard deviations.
        friction_offset (n_friction,): Their values as they were compensated; None for zero.

    Raises:
        SettingsError: If a name is unknown, a logarithmic parameter's nominal value is not positive, or a
            parameter starts at a bound or outside; all at once.
    """
    estimated = estimated_nuisances(robot, options)
    every = estimable_names(robot, options) | (
        {NUISANCE_KIND: [nuisance.name for nuisance in estimated]} if estimated else {}
    )
    kinds = tuple(every)
    masks = tuple(np.array([n is not None and n not in options.fixed for n in every[kind]], bool) for kind in kinds)
    free = {name: kind for kind in kinds for name in every[kind] if name is not None and name not in options.fixed}
    elements = tuple(free)
    check_names(options, every, nominal, unknown_names(robot, options))
    # Tied elements follow the internal parameter of another one; each of the others has its own.
    names = [name for name in elements if name not in options.tied]
    kind_of = [free[name] for name in names]
    unit_of, scale_of = _units_and_scales(robot, nominal, every, estimated)
    n_friction = len(friction_names)
    free_ends = np.full(len(names) + n_friction, np.inf)
    found = ParameterMap(
        nominal=nominal,
        kinds=kinds,
        masks=masks,
        elements=elements,
        member=np.array([names.index(options.tied.get(name, name)) for name in elements], int),
        element_scale=np.array([scale_of[name] for name in elements], float),
        names=(*names, *friction_names),
        kind_of=(*kind_of, *[FRICTION_KIND] * n_friction),
        units=(*(unit_of[name] for name in names), *map(coefficient_unit, friction_names)),
        logarithmic=np.array([PARAMETER_KINDS[kind].logarithmic for kind in kind_of] + [False] * n_friction, bool),
        prior_std=np.concatenate([_prior_std(robot, options, names, kind_of, scale_of), friction_std]),
        lower=-free_ends,
        upper=free_ends,
        friction_offset=np.zeros(n_friction) if friction_offset is None else friction_offset,
        cubic_std=_cubic_std(options),
    )
    return _bounded(_sensible(found, estimated), options.bounds)


def _units_and_scales(
    robot: Robot, nominal: ElasticParameters, every: Mapping[str, list[str | None]], estimated: Sequence[Nuisance]
) -> tuple[dict[str | None, str], dict[str | None, float]]:
    """Unit of each element of the free kinds, and its scale, 1 for the logarithmic ones."""
    units: dict[str | None, str] = {}
    found: dict[str | None, float] = {}
    scales = _scales(robot, nominal) | {NUISANCE_KIND: np.array([nuisance.common_std for nuisance in estimated])}
    for kind, names in every.items():
        own = [nuisance.unit for nuisance in estimated] if kind == NUISANCE_KIND else element_units(robot, kind)
        units |= dict(zip(names, own, strict=True))
        found |= dict(zip(names, scales.get(kind, np.ones(len(names))).tolist(), strict=True))
    return units, found


def _prior_std(
    robot: Robot, options: ElasticOptions, names: list[str], kinds: list[str], scales: Mapping[str | None, float]
) -> list[float]:
    """What robot file and other fits know of each parameter: deviations of internal values; infinite for nothing."""
    known = {**dict.fromkeys(LOGARITHMIC, np.log(10) * options.prior_decades), NUISANCE_KIND: PRIOR_FACTOR}
    known["cubic"] = _cubic_std(options)
    known |= {f"{joint.name}.motor_inertia": joint.motor.inertia_relative_std for joint in robot.joints}
    for spring in robot.springs:
        if spring.stiffness_std is not None:
            known[f"{spring.name}.stiffness"] = spring.stiffness_std
        cubic = f"{spring.name}.cubic"
        if spring.cubic_std is not None and cubic in scales:
            known[cubic] = spring.cubic_std / scales[cubic]
        slip = f"{spring.name}.{HYSTERESIS}"
        if spring.slip_std is not None and slip in scales:
            known[slip] = spring.slip_std / scales[slip]
    return [known.get(name, known.get(kind, np.inf)) for name, kind in zip(names, kinds, strict=True)]


def _cubic_std(options: ElasticOptions) -> float:
    # At the motor's largest torque T the slope of a cubic gear, k1 + 3 k3 (T / k1)^2, is known to the same factor as
    # k1: in units of its scale, k1^3 / T^2, k3 is known to a third of that factor.
    return float(10 ** min(options.prior_decades, _MOST_DECADES) / 3)


def _sensible(found: ParameterMap, estimated: Sequence[Nuisance]) -> ParameterMap:
    """Keeps nuisances within what makes sense, and tells what the robot file says of them."""
    if not estimated:
        return found
    lower, upper, stated = found.lower.copy(), found.upper.copy(), np.zeros(len(found.names))
    natural = np.ones(len(found.names))
    for nuisance in estimated:
        if nuisance.name in found.names:
            index = found.names.index(nuisance.name)
            lower[index], upper[index] = (
                _NOT_ALL * end / nuisance.common_std for end in (nuisance.least, nuisance.most)
            )
            stated[index], natural[index] = nuisance.stated, nuisance.natural
    return replace(found, lower=lower, upper=upper, stated=stated, natural=natural)


def _scales(robot: Robot, nominal: ElasticParameters) -> dict[str, FloatArray]:
    """Scale of each element of the linear kinds; a cubic gear's doubles the torque at the motor's limit."""
    limit = np.array([robot.joints[s.joint].motor.max_torque_nm for s in robot.springs])
    ratio = np.array([robot.joints[s.joint].motor.gear_ratio for s in robot.springs])
    return {
        "viscous": viscous_scale(nominal.motor_inertia),
        "arm_viscous": viscous_scale(nominal.link_inertia),
        "delay": np.array([1e-3]),
        "cubic": nominal.stiffness**3 / (limit * ratio) ** 2,
        "location": np.full(nominal.location.size, _LOCATION_SCALE_M),
    }


def _bounded(found: ParameterMap, bounds: Mapping[str, tuple[float, float]]) -> ParameterMap:
    """Puts bounds, given in the parameters' own units, on the internal values."""
    # In the optimizer's coordinates: log(end / nominal), or (end - nominal) / scale.
    ends = np.array([found.lower, found.upper])
    nominal, scale = found.nominal_values(), found.scale
    problems = []
    for name, (low, high) in bounds.items():
        index = found.names.index(name)
        if not low < nominal[index] < high:
            where = "at a bound of" if nominal[index] in (low, high) else "outside"
            problems.append(f"S057 `{name}` starts {where} {low:g} to {high:g}, at {nominal[index]:g}")
        elif found.logarithmic[index]:
            ends[:, index] = np.log(np.maximum([low, high], np.finfo(float).tiny) / nominal[index])
        else:
            ends[:, index] = (np.array([low, high]) - nominal[index]) / scale[index]
    if problems:
        remedy = "widen `bounds`, change the robot file's value, or put the parameter in `fixed`"
        raise SettingsError("; ".join(problems), where="fit", remedy=remedy)
    return replace(found, lower=ends[0], upper=ends[1])

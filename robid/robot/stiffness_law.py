"""Springs whose stiffness depends on a joint's position: the law's factor, and the energy that it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from robid.arrays import FloatArray, IntArray
from robid.robot.description import Spring, StiffnessLaw


@dataclass(frozen=True)
class Factor:
    """What a law multiplies a spring's torque by, and its derivatives by the joint's position.

    Attributes:
        value (...,): The factor.
        slope (...,): Its first derivative [1/rad, or 1/m].
        curvature (...,): Its second derivative [1/rad^2, or 1/m^2].
    """

    value: FloatArray
    slope: FloatArray
    curvature: FloatArray


class LawFactor:
    """Evaluates one law again and again.

    A table is interpolated by monotone cubics, which never overshoot (Fritsch and Carlson 1980), and held beyond its
    ends.

    Args:
        law: The law.
    """

    def __init__(self, law: StiffnessLaw) -> None:
        self._form = law.form
        if law.form == "table":
            table = PchipInterpolator(law.positions, law.values)
            self._pieces, self._table = np.asarray(table.c), law.positions
        else:
            slope = _derived(law.values)
            self._parts = law.values, slope, _derived(slope)

    def value(self, position: FloatArray) -> FloatArray:
        """Returns the factor (...,) at some positions (...,) [rad, or m]."""
        return self.rise(position)[0]

    def rise(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the factor and its slope (...,) at some positions (...,) [rad, or m]."""
        if self._form == "table":
            return self._tabulated(position)[:2]
        value, slope = _sum(self._parts[0], position), _sum(self._parts[1], position)
        if self._form == "stiffness":
            return value, slope
        factor = 1 / value
        return factor, -slope * factor * factor

    def whole(self, position: FloatArray) -> Factor:
        """Returns the factor with its derivatives at some positions (...,) [rad, or m]."""
        if self._form == "table":
            return Factor(*self._tabulated(position))
        curvature = _sum(self._parts[2], position)
        factor, slope = self.rise(position)
        if self._form == "compliance":
            curvature = 2 * slope * slope / factor - curvature * factor * factor
        return Factor(factor, slope, curvature)

    def _tabulated(self, position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        inside = np.clip(position, self._table[0], self._table[-1])
        piece = np.clip(np.searchsorted(self._table, inside, side="right") - 1, 0, self._table.size - 2)
        x, (a, b, c, d) = inside - self._table[piece], self._pieces[:, piece]
        within = inside == position
        value = ((a * x + b) * x + c) * x + d
        return value, within * ((3 * a * x + 2 * b) * x + c), within * (6 * a * x + 2 * b)


def _derived(coefficients: FloatArray) -> FloatArray:
    """Coefficients of a polynomial's derivative, constant first."""
    return coefficients[1:] * np.arange(1, coefficients.size) if coefficients.size > 1 else np.zeros(1)


def _sum(coefficients: FloatArray, position: FloatArray) -> FloatArray:
    """Value of a polynomial, constant first, by Horner's rule."""
    if coefficients.size == 1:
        return np.full(np.shape(position), coefficients[0])
    value = coefficients[-1] * position + coefficients[-2]
    for coefficient in coefficients[-3::-1] if coefficients.size > 2 else ():
        value = value * position + coefficient
    return np.asarray(value)


class VaryingSprings:
    """The springs of a robot whose stiffness depends on a joint's position.

    Such a spring holds the energy `f(p) U(d)`, with `U` that of the spring alone: its torque is `f U'`, and the
    joint feels `f' U` besides.

    Args:
        springs: All springs of the robot.
        arm (n_joint,): Index of each joint's arm position among the coordinates.
    """

    def __init__(self, springs: Sequence[Spring], arm: IntArray) -> None:
        laws = [(index, spring.stiffness_over) for index, spring in enumerate(springs)]
        pairs = [(index, law) for index, law in laws if law is not None]
        self.count = len(springs)
        self.indices = np.array([index for index, _ in pairs], int)
        self.scheduled = np.array([arm[law.joint] for _, law in pairs], int)
        self.laws = [LawFactor(law) for _, law in pairs]

    def __bool__(self) -> bool:
        return bool(self.laws)

    def factors(self, position: FloatArray) -> FloatArray:
        """Returns the factor (..., n_spring) of every spring where coordinates (..., n_dof) are."""
        found = np.ones((*position.shape[:-1], self.count))
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            found[..., index] = law.value(position[..., place])
        return found

    def load(self, position: FloatArray, energy: FloatArray) -> FloatArray:
        """Gradient of the energies along the scheduling coordinates.

        Args:
            position (n_dof,): Coordinates [rad, or m].
            energy (n_spring,): Energy `U` of each spring without its factor [J].

        Returns:
            What the coordinates (n_dof,) feel besides the springs' torques, as the gradient `f' U` [N m, or N].
        """
        found = np.zeros_like(position)
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            found[place] += law.whole(position[place]).slope * energy[index]
        return found

    def gradient(
        self, position: FloatArray, energy: FloatArray, torque: FloatArray, deflection: FloatArray
    ) -> FloatArray:
        """Hessian of the energies less what the springs' own stiffness gives.

        Args:
            position (n_dof,): Coordinates [rad, or m].
            energy (n_spring,): Energy `U` of each spring without its factor [J].
            torque (n_spring,): Its derivative `U'` [N m, or N].
            deflection (n_spring, n_dof): Deflection per coordinate.

        Returns:
            `f'' U` at the scheduling coordinate and `f' U'` between it and the deflection (n_dof, n_dof).
        """
        found = np.zeros((position.size, position.size))
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            factor = law.whole(position[place])
            across = factor.slope * torque[index] * deflection[index]
            found[place, place] += factor.curvature * energy[index]
            found[place] += across
            found[:, place] += across
        return found

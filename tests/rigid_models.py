"""Inverse dynamics written by hand, and rows of random linear models."""

import itertools

import numpy as np

from robid.models.rigid.fit.rows import Rows


class Slide:
    """The EMPS axis: mass, viscous and Coulomb friction (of either direction, if asymmetric) and an offset."""

    def __init__(self, asymmetric: bool = False) -> None:
        self.asymmetric = asymmetric
        self.names = ("M", "Fv+", "Fc+", "Fv-", "Fc-") if asymmetric else ("M", "Fv", "Fc", "offset")
        self.kinds = self.names
        self.units = ("",) * len(self.names)

    def columns(self, position, velocity, acceleration, *, torque=None, friction_speed=None, loaded=True):  # noqa: ARG002
        speed = velocity if friction_speed is None else friction_speed
        if self.asymmetric:
            forth, back = (speed > 0) * 1.0, (speed < 0) * 1.0
            parts = [acceleration, velocity * forth, forth, velocity * back, -back]
        else:
            parts = [acceleration, velocity, np.sign(speed), np.ones_like(speed)]
        return np.stack(parts, axis=-1)


class Arm:
    """Two links in a plane, with friction: the second one's inertia moves the first, not the other way round."""

    names = ("I1", "I2", "moment_x", "moment_y", "fv1", "fv2", "fc1", "fc2")
    kinds = names
    units = ("",) * 8

    def columns(self, position, velocity, acceleration, *, torque=None, friction_speed=None, loaded=True):  # noqa: ARG002
        sign = np.sign(velocity if friction_speed is None else friction_speed)
        first, second = position.T
        zero = np.zeros_like(first)
        both = acceleration.sum(axis=1)
        rows = [
            [acceleration[:, 0], both, np.cos(first), np.sin(first), velocity[:, 0], zero, sign[:, 0], zero],
            [zero, both, np.cos(first + second), np.sin(second), zero, velocity[:, 1], zero, sign[:, 1]],
        ]
        return np.moveaxis(np.array(rows), 2, 0)


def random_rows(n_row=400, deviations=(1.0,), parameters=(1.0, -2.0, 3.0), seed=0, noise=None, blocks=1):
    """Rows of a random linear model in blocks; Gaussian noise with a deviation a joint, unless it is given."""
    generator = np.random.default_rng(seed)
    columns = generator.standard_normal((n_row, len(deviations), len(parameters)))
    drawn = generator.standard_normal((n_row, len(deviations))) if noise is None else noise(generator)
    torque = columns @ np.array(parameters) + drawn * np.array(deviations)
    used = np.ones(torque.shape, dtype=bool)
    cuts = np.linspace(0, n_row, blocks + 1).astype(int)
    return tuple(Rows(columns[a:b], torque[a:b], used[a:b]) for a, b in itertools.pairwise(cuts))


def stacked(source):
    """All used rows of a source: regressor (n, n_param) and torque (n,)."""
    columns = np.concatenate([rows.columns[rows.used] for rows in source])
    return columns, np.concatenate([rows.torque[rows.used] for rows in source])


def whole_rows(columns, torque):
    """Rows that are whole in memory, all of which count."""
    return (Rows(columns, torque, np.ones(torque.shape, bool)),)

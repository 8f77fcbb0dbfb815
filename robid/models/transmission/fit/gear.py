"""One gear's parameters: which there are, what is known of them beforehand, and what the model makes of them.

The difference of a joint's encoders is, with the arm's angle `q` shown late by a lag and with its own errors,

    motor turns through the gears - arm(t + lag) = x(torque) - e(motor) - e(arm) - scale q - offset
        + (share of friction behind the gear) friction / k - (damping / k + lag of the torque) dx/dt,

with `x` of the gear's law and `e` sums of sines. Torques are those of the links with their doubts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.transmission.fit.law import BAND_SHARE, GearLaw, deflections
from robid.models.transmission.fit.load import Load
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.tracks import Track

_LOG_STIFFNESS_STD = 2.0
_STIFFENING_STD = 1.0  # of the share by which stiffness grows up to the largest deflection
_SLIP_STD = 0.1  # of the largest torque
_REACH_SHARE, _REACH_STD = 0.3, 1.0  # of the largest deflection; of its logarithm
_BACKLASH_STD = 0.5  # of the largest deflection
_START_STD = 0.6
_OFFSET_STD = 0.1  # rad
_TELLING = 0.02  # of the largest effect of a doubt
_MOVE = 1e-5  # by which numbers of the law are moved for slopes


@dataclass(frozen=True)
class GearData:
    """What one gear's parameters are estimated from, of each motion."""

    tracks: tuple[Track, ...]
    column: int  # Which of the gears it is
    joint: int  # Which of the joints
    ratio: float
    torque: tuple[FloatArray, ...]  # (n_row,) each [N m, or N]
    doubts: tuple[FloatArray, ...]  # (n_row, n_doubt) each
    coulomb: float  # Friction of its motor [N m]
    viscous: float
    rated: float  # Rated torque [N m, or N]

    @property
    def largest(self) -> float:
        """The largest torque of all motions."""
        return max(float(np.abs(own).max()) for own in self.torque)

    @property
    def rows(self) -> tuple[slice, ...]:
        """Which rows are each motion's, all one after the other."""
        ends = np.cumsum([0, *(len(own) for own in self.torque)]).tolist()
        return tuple(slice(*pair) for pair in pairwise(ends))


def gear_data(
    tracks: Sequence[Track], load: Load, gears: Sequence[int], column: int, ratio: float, rated: float
) -> GearData:
    """Returns what one of the gears is estimated from, with the few doubts that say it all of this one."""
    doubts = [own[:, column] for own in load.doubts]
    values, axes = np.linalg.eigh(np.sum([own.T @ own for own in doubts], axis=0))
    kept = axes[:, values > _TELLING**2 * values[-1]][:, ::-1]
    return GearData(
        tracks=tuple(tracks),
        column=column,
        joint=gears[column],
        ratio=ratio,
        torque=tuple(own[:, column] for own in load.torque),
        doubts=tuple(own @ kept for own in doubts),
        coulomb=float(load.coulomb[column]),
        viscous=float(load.viscous[column]),
        rated=rated,
    )


@dataclass(frozen=True)
class GearModel:
    """The parameters of a gear, each about its prior, and the model of the encoders' difference."""

    data: GearData
    options: TransmissionFitOptions
    names: tuple[str, ...]
    centre: FloatArray  # (n_param,) Most probable values beforehand
    std: FloatArray  # (n_param,) Deviations of these; zero for what is not estimated
    scale: float  # Deflection that its numbers are related to: the largest of a linear gear [rad, or m]
    largest: float  # Torque that they are related to: the largest [N m, or N]

    def place(self, name: str) -> int:
        """Index of a parameter."""
        return self.names.index(name)

    @property
    def n_own(self) -> int:
        """How many of the parameters come before the doubts of what loads the gear."""
        return sum(not name.startswith("doubt_") for name in self.names)

    @property
    def is_doubt(self) -> BoolArray:
        """Which parameters (n_param,) are doubts of what loads the gear, which every motion shares."""
        return np.array([name.startswith("doubt_") or name == "share" for name in self.names], bool)

    def law(self, values: FloatArray) -> GearLaw:
        """Returns the gear's law for some values (n_param,)."""
        k, s, slip, reach, backlash = (values[self.place(name)] for name in _LAW)
        return GearLaw(
            stiffness=np.array([np.exp(k)]),
            stiffening=np.array([s / self.scale**2]),
            slip=np.array([max(slip, 0.0) * self.largest]),
            reach=np.array([np.exp(reach) * self.scale]),
            backlash=np.array([backlash * self.scale]),
        )

    def predict(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns the measured difference, its model (n_row,) each, and the slopes (n_row, n_param) of their residual.

        The residual is measured less modelled; slopes are those of the model less those of what is measured.
        """
        stretched, by_law = self._stretch(values)
        added = [place for place, name in enumerate(self.names) if name in _ADDED or name.startswith("wave_")]
        lag, column = float(values[self.place("lag")]), self.data.column
        measured = np.empty(len(stretched))
        for index, (track, rows) in enumerate(zip(self.data.tracks, self.data.rows, strict=True)):
            shown, by_law[rows, self.place("lag")] = track.shown.later(lag, column)
            measured[rows] = track.geared.position[:, column] - shown
            for name, own in self._linear(values, index, stretched[rows]):
                by_law[rows, self.place(name)] = own
        return measured, stretched + by_law[:, added] @ values[added], by_law

    def deflection(self, values: FloatArray) -> FloatArray:
        """The gear's deflection (n_row,) by its law along all motions [rad, or m]."""
        return self._stretch(values)[0]

    def _stretch(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The gear's deflection (n_row,) and its slopes (n_row, n_param) by the law's numbers and the doubts.

        All motions and all variants of the law are followed side by side, so that time is gone through once.
        """
        data = self.data
        doubts = [place for place, name in enumerate(self.names) if name.startswith("doubt_")]
        places = [self.place(name) for name in (*_LAW, "start_0") if self.std[self.place(name)] > 0]
        steps = [_MOVE * max(1.0, abs(values[place])) for place in places]
        variants = [values, *(self._moved(values, *pair) for pair in zip(places, steps, strict=True))]
        variants += [values] * len(doubts)
        laws = [self.law(each) for each in variants] * len(data.torque)
        joined = GearLaw(*(np.concatenate([getattr(law, name) for law in laws]) for name in _LAW))
        most, n_variant = max(len(own) for own in data.torque), len(variants)
        loads, starts = [], []
        for index, (torque, moved) in enumerate(zip(data.torque, data.doubts, strict=True)):
            load = np.repeat((torque + moved @ values[doubts])[:, None], n_variant, axis=1)
            load[:, n_variant - len(doubts) :] += _MOVE * moved
            loads.append(np.concatenate([load, np.repeat(load[-1:], most - len(load), axis=0)]))
            begun = [each[self.place(f"start_{index}")] for each in variants]
            begun[1 : 1 + len(places)] = [
                values[self.place(f"start_{index}")] + step * (self.names[place] == "start_0")
                for place, step in zip(places, steps, strict=True)
            ]
            starts.append(np.clip(begun, -1.0, 1.0))
        found = deflections(joined, np.concatenate(loads, axis=1), self.band, np.concatenate(starts))
        stretched, slopes = np.empty(data.rows[-1].stop), np.zeros((data.rows[-1].stop, len(self.names)))
        for index, rows in enumerate(data.rows):
            own = found[: len(data.torque[index]), index * n_variant : (index + 1) * n_variant]
            stretched[rows] = own[:, 0]
            change = own[:, 1:] - own[:, :1]
            at = [self.place(f"start_{index}") if self.names[place] == "start_0" else place for place in places]
            slopes[rows.start : rows.stop, at] = change[:, : len(places)] / steps
            slopes[rows.start : rows.stop, doubts] = change[:, len(places) :] / _MOVE
        return stretched, slopes

    @staticmethod
    def _moved(values: FloatArray, place: int, step: float) -> FloatArray:
        moved = values.copy()
        moved[place] += step
        return moved

    @property
    def band(self) -> float:
        """Torque over which the deflection changes its side by the backlash."""
        return BAND_SHARE * self.data.rated

    def _linear(self, values: FloatArray, index: int, stretched: FloatArray) -> list[tuple[str, FloatArray]]:
        """Columns of what the model is linear in."""
        data, track = self.data, self.data.tracks[index]
        compliance = float(np.exp(-values[self.place("stiffness")]))
        arm = track.arm.position[:, data.joint]
        friction = data.coulomb * track.sense[:, data.joint] + data.viscous * track.motor.speed[:, data.joint]
        found = [
            ("torque_lag", -np.gradient(stretched, track.period_s)),
            ("scale", -arm),
            ("offset", -np.ones_like(arm)),
            ("share", compliance * data.ratio * friction),
        ]
        for order, turns in enumerate(self.options.gear.arm_orders):
            found += [(f"wave_arm_{order}_sin", -np.sin(turns * arm)), (f"wave_arm_{order}_cos", -np.cos(turns * arm))]
        for order in range(len(self.options.gear.motor_orders)):
            sine, cosine = track.waves[:, data.column, order].T
            found += [(f"wave_motor_{order}_sin", -sine), (f"wave_motor_{order}_cos", -cosine)]
        return found


_LAW = ("stiffness", "stiffening", "slip", "reach", "backlash")
_ADDED = ("torque_lag", "scale", "offset", "share")


def gear_model(
    data: GearData, options: TransmissionFitOptions, stiffness: float, largest: float | None = None
) -> GearModel:
    """Lays out the parameters of a gear about a first guess of its stiffness.

    They are related to the largest torque, and to the deflection that it gives: those of the data unless stated.
    """
    gear, prior = options.gear, options.prior
    largest = data.largest if largest is None else largest
    scale = largest / stiffness
    rows: list[tuple[str, float, float]] = [
        ("stiffness", float(np.log(stiffness)), _LOG_STIFFNESS_STD),
        ("stiffening", 0.0, _STIFFENING_STD * gear.stiffening),
        ("slip", 0.0, _SLIP_STD * gear.hysteresis),
        ("reach", float(np.log(_REACH_SHARE)), _REACH_STD * gear.hysteresis),
        ("backlash", 0.0, _BACKLASH_STD * gear.backlash),
        ("lag", 0.0, prior.lag_s),
        ("torque_lag", 0.0, prior.torque_lag_s),
        ("scale", 0.0, prior.scale),
        ("offset", 0.0, _OFFSET_STD),
        ("share", 0.0, prior.friction_share),
    ]
    for kind, orders, std in (
        ("arm", gear.arm_orders, prior.eccentricity_rad),
        ("motor", gear.motor_orders, prior.transmission_error_rad),
    ):
        for order in range(len(orders)):
            rows += [(f"wave_{kind}_{order}_{wave}", 0.0, std) for wave in ("sin", "cos")]
    rows += [(f"start_{index}", 0.0, _START_STD * gear.hysteresis) for index in range(len(data.tracks))]
    rows += [(f"doubt_{index}", 0.0, 1.0) for index in range(data.doubts[0].shape[1])]
    centre, deviation = (np.array([row[which] for row in rows]) for which in (1, 2))
    return GearModel(data, options, tuple(row[0] for row in rows), centre, deviation, scale, largest)

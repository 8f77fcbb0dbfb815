"""One gear's parameters: which there are, what is known of them beforehand, and what the model makes of them.

A gear's deflection `x` is the difference of its joint's encoders, the arm's angle `q` shown late by a lag and both with
their errors:

    x = motor turns through the gears - arm(t + lag) + e(motor) + e(arm) + scale q + offset,

with `e` sums of sines. The torque behind the gear, of the links with their doubts, bends it:

    torque / k = x + s x^3 - b/2 tanh(k x / band) + (H / k) h(x) + (damping / k + lag of the torque) d(torque / k)/dt
        - (share of friction behind the gear) friction / k,

both sides behind one low pass. In place of the cube, stiffness may rise in steps at torques of a data sheet. Hysteresis
`h` remembers the deflection itself, up to the frequencies of transmission errors: these shake it loose, which a smooth
torque would not show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.transmission.fit.gear_data import GearData
from robid.models.transmission.fit.law import BAND_SHARE, GearLaw, memories
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.signals.filters import low_pass

_LOG_STIFFNESS_STD = 2.0
_STIFFENING_STD = 1.0  # of the share by which stiffness grows up to the largest deflection
_RISE_STD = 1.0  # of the stiffness without load, at each step
_SLIP_STD, _RATED_SLIP_STD = 0.3, 0.1  # of the largest torque, or of the rated one where that is more
_REACH, _RATED_REACH = 1.0, 0.3  # of the largest deflection, or of that under the rated torque where that is more
_REACH_STD = 1.5  # of its logarithm
_START_STD = 0.6
_OFFSET_STD = 0.1  # rad
_MOVE = 1e-4  # by which numbers of the law are moved for slopes
_TIMES = 2  # passes in which hysteresis follows the deflection
_NOISES = 1.5  # deviations of the encoders' noise that are no motion


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
            torques=self.data.steps,
            rises=np.array([[values[self.place(f"{RISE}{step}")] for step in range(len(self.data.steps))]]),
        )

    def predict(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns the measured difference, its model (n_row,) each, and the slopes (n_row, n_param) of their residual.

        The residual is measured less modelled; slopes are those of the model less those of what is measured.
        """
        parts = [self._motion(values, index) for index in range(len(self.data.tracks))]
        measured, left, slopes = (np.concatenate([part[which] for part in parts]) for which in range(3))
        return measured, measured - left, -slopes

    def deflection(self, values: FloatArray) -> FloatArray:
        """The gear's deflection (n_row,) along all motions, as the encoders show it [rad, or m]."""
        return np.concatenate([self._followed(values, index)[2] for index in range(len(self.data.tracks))])

    def _motion(self, values: FloatArray, index: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measured difference and residual (n_row,), and the residual's slopes (n_row, n_param), of one motion."""
        data, track = self.data, self.data.tracks[index]
        law, at = self.law(values), {name: place for place, name in enumerate(self.names)}
        k = float(law.stiffness[0])
        slopes = np.zeros((len(track.time_s), len(self.names)))
        fine, measured, stretch = self._followed(values, index, slopes)
        friction = data.ratio * (
            data.coulomb * track.sense[:, data.joint] + data.viscous * track.motor.speed[:, data.joint]
        )
        doubts = [place for name, place in at.items() if name.startswith("doubt_")]
        torque = data.torque[index] + data.doubts[index] @ values[doubts] + values[at["share"]] * friction
        rate = np.gradient(torque, track.period_s)
        rising = values[at["torque_lag"]]
        bent = law.bent(stretch[:, None])[1][:, 0]
        left = np.zeros(len(stretch))
        for _ in range(_TIMES):
            # Hysteresis remembers what the law says of slow deflections, in which no noise of the encoders is.
            quiet = fine - np.interp(np.arange(len(fine)), track.fine.rows, left)
            # Behind the low pass: side within the backlash, memory of the deflection, and what the spring adds.
            side, memory, by_reach, by_start, by_shape, added, *by_law = self._passed(values, index, quiet)
            load = (law.slip[0] * memory - torque + rising * rate) / k
            left = (stretch + added - 0.5 * law.backlash[0] * side + load) / bent
        for name, column in {
            **dict(zip(self._of_spring, by_law, strict=True)),
            "stiffness": by_law[0] - load,
            "slip": self.largest * memory / k,
            "reach": law.slip[0] * by_reach / k,
            f"start_{index}": law.slip[0] * by_start / k,
            "shape": law.slip[0] * by_shape / k,
            "backlash": -0.5 * self.scale * side,
            "torque_lag": rate / k,
            "share": -friction / k,
        }.items():
            slopes[:, at[name]] = column / bent
        slopes[:, doubts] = -data.doubts[index] / (k * bent)[:, None]
        return measured, left, slopes

    def _followed(
        self, values: FloatArray, index: int, slopes: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Fine deflection (n_fine,), measured difference and deflection (n_row,) of one motion.

        Fills the slopes (n_row, n_param) of the deflection by what is not the gear's law.
        """
        data, track = self.data, self.data.tracks[index]
        fine, column = track.fine, data.column
        lag = float(values[self.place("lag")])
        difference, arm = fine.geared[:, column] - fine.later(lag, column), fine.shown[:, column]
        columns = {"scale": arm, "offset": np.ones_like(arm)}
        for order, turns in enumerate(self.options.gear.arm_orders):
            columns |= {f"wave_arm_{order}_sin": np.sin(turns * arm), f"wave_arm_{order}_cos": np.cos(turns * arm)}
        for order in range(len(self.options.gear.motor_orders)):
            sine, cosine = fine.waves[:, column, order].T
            columns |= {f"wave_motor_{order}_sin": sine, f"wave_motor_{order}_cos": cosine}
        places = [self.place(name) for name in columns]
        errors = np.stack(list(columns.values()), axis=1)
        deflection = difference + errors @ values[places]
        later, by_lag = track.shown.later(lag, column)
        measured = track.geared.position[:, column] - later
        smooth = self._smooth(errors, index)
        if slopes is not None:
            slopes[:, places], slopes[:, self.place("lag")] = smooth, -by_lag
        return deflection, measured, measured + smooth @ values[places]

    def _passed(self, values: FloatArray, index: int, deflection: FloatArray) -> tuple[FloatArray, ...]:
        """What becomes of a fine deflection (n_fine,) behind the low pass (n_row,) each.

        Its side, the memory of hysteresis, the memory's slopes by the logarithm of its reach, by what it begins with
        and by its shape (a share of it may build up sooner or later), what stiffening adds, and that one's slopes.
        """
        law, start = self.law(values), float(np.clip(values[self.place(f"start_{index}")], -1, 1))
        reach, step = float(law.reach[0]), _MOVE
        noise = _NOISES * float(self.data.tracks[index].fine.noise[self.data.column])
        memory = memories(
            deflection,
            reach * np.array([1.0, np.exp(step), 1.0, 2.0, 0.5]),
            np.array([start, start, start - step, start, start]),
            noise,
        )
        side = np.tanh(float(law.stiffness[0]) * deflection / self.band)
        shape = 0.5 * (memory[:, 3] - memory[:, 4])
        remembered = memory[:, 0] + values[self.place("shape")] * shape
        by_reach, by_start = (memory[:, 1] - memory[:, 0]) / step, (memory[:, 0] - memory[:, 2]) / step
        every = np.stack([side, remembered, by_reach, by_start, shape, *self._added(values, deflection)], axis=1)
        return tuple(self._smooth(every, index).T)

    @property
    def _of_spring(self) -> tuple[str, ...]:
        """Names of the parameters that say what stiffening adds."""
        return ("stiffness", *(f"{RISE}{step}" for step in range(len(self.data.steps))), "stiffening")

    def _added(self, values: FloatArray, deflection: FloatArray) -> list[FloatArray]:
        """What stiffening adds to a deflection (n_fine,), and its slopes by the parameters `_of_spring`."""
        cube, steps = deflection**3, len(self.data.steps)
        if not steps:
            return [float(self.law(values).stiffening[0]) * cube, np.zeros_like(cube), cube / self.scale**2]
        # By differences: where stiffness rises depends on the rises before.
        moved = [values, *(values + _MOVE * (np.array(self.names) == name) for name in self._of_spring[: steps + 1])]
        base, *others = (self.law(each).bent(deflection[:, None])[0][:, 0] - deflection for each in moved)
        return [base, *((other - base) / _MOVE for other in others), cube / self.scale**2]

    def _smooth(self, signal: FloatArray, index: int) -> FloatArray:
        """Passes fine signals (n_fine, n) through the low pass of the rows (n_row, n)."""
        fine = self.data.tracks[index].fine
        return low_pass(signal, fine.period_s, self.options.cut_hz)[fine.rows]

    @property
    def band(self) -> float:
        """Torque over which the deflection changes its side by the backlash."""
        return BAND_SHARE * self.data.rated


_LAW = ("stiffness", "stiffening", "slip", "reach", "backlash")
RISE = "rise_"
"""Beginning of the names of the shares by which stiffness rises in steps."""


def gear_model(
    data: GearData, options: TransmissionFitOptions, stiffness: float, largest: float | None = None
) -> GearModel:
    """Lays out the parameters of a gear about a first guess of its stiffness.

    They are related to the largest torque, and to the deflection that it gives: those of the data unless stated.
    """
    gear, prior = options.gear, options.prior
    largest = data.largest if largest is None else largest
    scale, rated = largest / stiffness, data.rated / largest
    rows: list[tuple[str, float, float]] = [
        ("stiffness", float(np.log(stiffness)), _LOG_STIFFNESS_STD),
        ("stiffening", 0.0, _STIFFENING_STD * (gear.stiffening and not data.steps.size)),
        # A gear that bears little of what it is made for has the hysteresis that it is made with.
        ("slip", 0.0, max(_SLIP_STD, _RATED_SLIP_STD * rated) * gear.hysteresis),
        ("reach", float(np.log(max(_REACH, _RATED_REACH * rated))), _REACH_STD * gear.hysteresis),
        ("backlash", 0.0, prior.backlash_rad / scale * gear.backlash),
        ("shape", 0.0, prior.hysteresis_shape * gear.hysteresis),
        ("lag", 0.0, prior.lag_s),
        ("torque_lag", 0.0, prior.torque_lag_s),
        ("scale", 0.0, prior.scale),
        ("offset", 0.0, _OFFSET_STD),
        ("share", 0.0, prior.friction_share),
    ]
    most = max((len(each) for each in options.stiffness_torques_nm.values()), default=0)
    rows += [(f"{RISE}{step}", 0.0, _RISE_STD * (step < data.steps.size)) for step in range(most)]
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

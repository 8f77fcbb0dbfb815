"""The record: sampled signals of one campaign, simulated or measured."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from robid.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Record:
    """Whole periods of the steady state, simulated or measured.

    Attributes:
        sampling_period_s: Sampling period of all channels [s].
        configurations (n_conf, n_joint): Arm-side joint positions, encoder side of the gears [rad, or m].
        torque (n_conf, n_real, n_exp, n_period, n_sample, n_in): Motor torque, motor side [N m].
        position (n_conf, n_real, n_exp, n_period, n_sample, n_out): Measured angles relative to
            `position_offset_rad`: motor side for motors, arm side for link encoders [rad]; of trackers the
            position [m], of accelerometers the acceleration itself [m/s^2].
        reference (n_conf, n_real, n_exp, n_sample, n_in): One period of what was injected, or None.
        reference_kind: What `reference` is: `speed_reference`, `position_reference`, `torque`, or "".
        excited_lines (n_freq,): Excited DFT lines of one period.
        detection_lines (n_detection,): Odd lines of the band that were left out on purpose.
        input_names: Name of each torque channel.
        output_names: Name of each position channel; collocated channels carry the motor's name.
        position_offset_rad (n_conf, n_out): Offset subtracted from `position`, in the channel's unit.
        torque_unit: `N m`, or the unit that stands for it (a current where K_t is unknown).
        torque_hold: `zoh` where the torque is a command held for a sample, `band_limited` where it was measured
            behind the same anti-aliasing as the angles.
        torque_relative_std (n_in,): Standard deviation of the relative error of the torque's scale, or None
            where the scale is exact.
        accelerations: Names of the outputs that are accelerations.
        joint_units: Unit of each joint's position; None where all are angles.
        truth_sha256: Hash of the file with the truth that was simulated; "" where it is unknown.
        notes: What the import or the simulation wants the reader to know.
    """

    sampling_period_s: float
    configurations: FloatArray
    torque: FloatArray
    position: FloatArray
    reference: FloatArray | None
    reference_kind: str
    excited_lines: IntArray
    detection_lines: IntArray
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    position_offset_rad: FloatArray
    torque_unit: str = "N m"
    torque_hold: Literal["zoh", "band_limited"] = "zoh"
    torque_relative_std: FloatArray | None = None
    accelerations: tuple[str, ...] = ()
    truth_sha256: str = ""
    joint_units: tuple[str, ...] | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def period_s(self) -> float:
        """Length of one period [s]."""
        return float(self.torque.shape[4]) * self.sampling_period_s

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies (n_freq,) [Hz]."""
        return np.asarray(self.excited_lines / self.period_s)

    def as_one_period(self) -> Record:
        """Returns the record with all periods of an experiment as a single one, its lines counted anew."""
        periods = self.torque.shape[3]
        return replace(
            self,
            torque=self.torque.reshape(*self.torque.shape[:3], 1, -1, self.torque.shape[5]),
            position=self.position.reshape(*self.position.shape[:3], 1, -1, self.position.shape[5]),
            reference=None if self.reference is None else np.tile(self.reference, (1, 1, 1, periods, 1)),
            excited_lines=self.excited_lines * periods,
            detection_lines=self.detection_lines * periods,
        )

    def select(self, configuration: int) -> Record:
        """Returns the record of one configuration, its axis kept."""
        part = slice(configuration, configuration + 1)
        return replace(
            self,
            configurations=self.configurations[part],
            torque=self.torque[part],
            position=self.position[part],
            reference=None if self.reference is None else self.reference[part],
            position_offset_rad=self.position_offset_rad[part],
        )

    def realizations(self, count: int, first: int = 0) -> Record:
        """Returns the record of some successive realizations."""
        chosen = slice(first, first + count)
        return replace(
            self,
            torque=self.torque[:, chosen],
            position=self.position[:, chosen],
            reference=None if self.reference is None else self.reference[:, chosen],
        )

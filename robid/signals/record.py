"""The record: sampled signals of one campaign, simulated or measured."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.signals.quantities import Channel, channel_names


def _no_lines() -> IntArray:
    return np.zeros(0, int)


@dataclass(frozen=True)
class Record:
    """Whole periods of the steady state, or one shot: samples that do not repeat.

    A record of one shot has one period, which is all of its samples. It has no excited lines, and may have no
    configuration to rest in; or its signal is arbitrary and carries all DFT bins, of which `excited_lines` are those
    where a response is wanted.

    Attributes:
        sampling_period_s: Sampling period of all channels [s].
        inputs (n_conf, n_real, n_exp, n_period, n_sample, n_in): Inputs, in their channels' units.
        outputs (n_conf, n_real, n_exp, n_period, n_sample, n_out): Outputs less `output_offset`, in their channels'
            units.
        output_offset (n_conf, n_out): What was subtracted from `outputs`.
        input_channels: What each input is.
        output_channels: What each output is.
        configurations (n_conf, n_joint): Arm-side joint positions, encoder side of the gears [rad, or m]; None for a
            record that does not begin and stay at rest.
        reference (n_conf, n_real, n_exp, n_sample, n_reference): One period of what was injected, or None.
        reference_channels: What each column of `reference` is; empty where there is none.
        excited_lines (n_freq,): Excited DFT lines of one period; none for one shot whose signal is not arbitrary.
        detection_lines (n_detection,): Odd lines of the band that were left out on purpose.
        segments: Segments of one over the resolution that an arbitrary signal is long, so that `excited_lines` are
            multiples of it; 0 for any other.
        input_hold: `zoh` where the inputs are commands held for a sample, `band_limited` where they were measured
            behind the same anti-aliasing as the outputs.
        input_relative_std (n_in,): Standard deviation of the relative error of each input's scale, or None
            where the scale is exact.
        joint_units: Unit of each joint's position; None where all are angles.
        truth_sha256: Hash of the file with the truth that was simulated; "" where it is unknown.
        notes: What the import or the simulation wants the reader to know.
    """

    sampling_period_s: float
    inputs: FloatArray
    outputs: FloatArray
    output_offset: FloatArray
    input_channels: tuple[Channel, ...]
    output_channels: tuple[Channel, ...]
    configurations: FloatArray | None = None
    reference: FloatArray | None = None
    reference_channels: tuple[Channel, ...] = ()
    excited_lines: IntArray = field(default_factory=_no_lines)
    detection_lines: IntArray = field(default_factory=_no_lines)
    segments: int = 0
    input_hold: Literal["zoh", "band_limited"] = "zoh"
    input_relative_std: FloatArray | None = None
    truth_sha256: str = ""
    joint_units: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()

    @property
    def input_names(self) -> tuple[str, ...]:
        """Name of each input."""
        return channel_names(self.input_channels)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Name of each output."""
        return channel_names(self.output_channels)

    @property
    def is_one_shot(self) -> bool:
        """Whether the samples do not repeat."""
        return self.is_arbitrary or not len(self.excited_lines)

    @property
    def is_arbitrary(self) -> bool:
        """Whether the samples do not repeat, and a response at some frequencies is wanted all the same."""
        return self.segments > 0

    @property
    def period_s(self) -> float:
        """Length of one period, or of the whole shot [s]."""
        return float(self.inputs.shape[4]) * self.sampling_period_s

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies (n_freq,) [Hz]."""
        return np.asarray(self.excited_lines / self.period_s)

    def require_periods(self, reader: str) -> FloatArray:
        """Returns the configurations (n_conf, n_joint) of a record with lines around a configuration [rad].

        Args:
            reader: What needs its lines, for the message.

        Raises:
            DataError: If the record has no lines, or no configuration to rest in.
        """
        if not len(self.excited_lines) or self.configurations is None:
            lacks = "no configuration that it rests in"
            lacks = lacks if len(self.excited_lines) else "no period and no excited lines"
            what = f"{reader} needs a periodic excitation around a configuration at rest; the record has {lacks}"
            raise DataError(what, remedy="read it with a family that reads records, or name another campaign")
        return self.configurations

    def as_one_period(self) -> Record:
        """Returns the record with all periods of an experiment as a single one, its lines counted anew."""
        periods = self.inputs.shape[3]
        return replace(
            self,
            inputs=self.inputs.reshape(*self.inputs.shape[:3], 1, -1, self.inputs.shape[5]),
            outputs=self.outputs.reshape(*self.outputs.shape[:3], 1, -1, self.outputs.shape[5]),
            reference=None if self.reference is None else np.tile(self.reference, (1, 1, 1, periods, 1)),
            excited_lines=self.excited_lines * periods,
            detection_lines=self.detection_lines * periods,
        )

    def shortened(self, segments: int) -> Record:
        """Returns the first segments of an arbitrary signal."""
        n_sample = self.inputs.shape[4] // self.segments * segments
        return replace(
            self,
            inputs=self.inputs[..., :n_sample, :],
            outputs=self.outputs[..., :n_sample, :],
            reference=None if self.reference is None else self.reference[..., :n_sample, :],
            excited_lines=self.excited_lines // self.segments * segments,
            segments=segments,
        )

    def select(self, configuration: int) -> Record:
        """Returns the record of one configuration, its axis kept."""
        part = slice(configuration, configuration + 1)
        return replace(
            self,
            configurations=None if self.configurations is None else self.configurations[part],
            inputs=self.inputs[part],
            outputs=self.outputs[part],
            reference=None if self.reference is None else self.reference[part],
            output_offset=self.output_offset[part],
        )

    def realizations(self, count: int, first: int = 0) -> Record:
        """Returns the record of some successive realizations."""
        chosen = slice(first, first + count)
        return replace(
            self,
            inputs=self.inputs[:, chosen],
            outputs=self.outputs[:, chosen],
            reference=None if self.reference is None else self.reference[:, chosen],
        )

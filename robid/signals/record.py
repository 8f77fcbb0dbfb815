"""The record: sampled signals of one campaign, simulated or measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity, part_of
from robid.errors import DataError
from robid.signals.quantities import Channel, channel_names, joint_unit, units_text


def _no_lines() -> IntArray:
    return np.zeros(0, int)


def place_words(place: Sequence[int], counts: Sequence[int]) -> list[str]:
    """Says which configuration, realization and experiment it is, counted from 1, where there are several."""
    words = ("configuration", "realization", "experiment")
    every = zip(words, place, counts, strict=False)
    return [f"{word} {index + 1}" for word, index, count in every if count > 1]


_SAMPLES = "configuration realization experiment period sample"


@dataclass(frozen=True)
class Record:
    """Whole periods of the steady state, or one shot: samples that do not repeat.

    A record of one shot has one period, which is all of its samples. It has no excited lines, and may have no
    configuration to rest in; or its signal is arbitrary and carries all DFT bins, of which `excited_lines` are those
    where a response is wanted.
    """

    sampling_period_s: float  # Sampling period of all channels [s]
    inputs: Annotated[FloatArray, Quantity("{input}", f"{_SAMPLES} input", "Inputs, by their channels", compact=True)]
    outputs: Annotated[
        FloatArray,
        Quantity("{output}", f"{_SAMPLES} output", "Outputs less their offset, by their channels", compact=True),
    ]
    output_offset: Annotated[
        FloatArray, Quantity("{output}", "configuration output", "Offset subtracted from the outputs")
    ]
    input_channels: Annotated[tuple[Channel, ...], Quantity("1", "input", "What each input is")]
    output_channels: Annotated[tuple[Channel, ...], Quantity("1", "output", "What each output is")]
    # Arm-side joint positions, encoder side of the gears; None for a record that does not begin and stay at rest
    configurations: Annotated[FloatArray | None, Quantity("{joint}", "configuration joint", "Arm-side joints")] = None
    reference: Annotated[
        FloatArray | None,
        Quantity(
            "{reference}",
            "configuration realization experiment sample reference",
            "One period of the injected signal",
            compact=True,
        ),
    ] = None
    reference_channels: Annotated[
        tuple[Channel, ...], Quantity("1", "reference", "What each column of the reference is")
    ] = ()
    # Excited DFT lines of one period; none for one shot whose signal is not arbitrary
    excited_lines: Annotated[
        IntArray, Quantity("1", "frequency", "Excited DFT lines of one period; none for one shot")
    ] = field(default_factory=_no_lines)
    detection_lines: Annotated[IntArray, Quantity("1", "detection", "DFT lines left out to detect distortion")] = field(
        default_factory=_no_lines
    )
    # Segments of one over the resolution that an arbitrary signal is long, so that `excited_lines` are multiples of it;
    # 0 for any other
    segments: int = 0
    # `zoh` where the inputs are commands held for a sample, `band_limited` where they were measured behind the same
    # anti-aliasing as the outputs
    input_hold: Literal["zoh", "band_limited"] = "zoh"
    input_relative_std: Annotated[
        FloatArray | None, Quantity("1", "input", "Standard deviation of the input scale's relative error")
    ] = None
    truth_sha256: str = ""  # Hash of the file with the truth that was simulated; "" where it is unknown
    joint_units: Annotated[tuple[str, ...] | None, Quantity("1", "joint", "Units of the joints' positions")] = None
    # What the import or the simulation wants the reader to know
    notes: Annotated[tuple[str, ...], Quantity("1", "note")] = ()

    def __repr__(self) -> str:
        *axes, n_sample, _ = self.inputs.shape
        names = ("configurations", "realizations", "experiments", "periods")
        sizes = ", ".join(f"{size} {name}" for size, name in zip(axes, names, strict=True))
        channels = f"outputs {', '.join(self.output_names)}; inputs {', '.join(self.input_names)}"
        return f"record of {sizes}, each of {n_sample} samples every {self.sampling_period_s:g} s\n{channels}"

    @property
    def own_units(self) -> dict[str, str]:
        """Units that its channels and joints decide."""
        inputs, outputs = units_text(self.input_channels), units_text(self.output_channels)
        reference = units_text(self.reference_channels)
        return {"input": inputs, "output": outputs, "reference": reference, "joint": joint_unit(self.joint_units)}

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
            what = f"D216 {reader} needs a periodic excitation around a configuration at rest; the record has {lacks}"
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
        part = part_of(self, "sample", slice(self.inputs.shape[4] // self.segments * segments))
        return replace(part, excited_lines=self.excited_lines // self.segments * segments, segments=segments)

    def select(self, configuration: int) -> Record:
        """Returns the record of one configuration, its axis kept."""
        return part_of(self, "configuration", slice(configuration, configuration + 1))

    def realizations(self, count: int, first: int = 0) -> Record:
        """Returns the record of some successive realizations."""
        return part_of(self, "realization", slice(first, first + count))

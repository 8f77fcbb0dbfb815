"""What files of measured frequency responses hold: channels, columns, units, timing, and where their covariance is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from robid.arrays import option
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import Dialect

ResponseFormat: TypeAlias = Literal["csv", "uff", "mat", "json", "hdf5"]
"""The formats of responses that are read."""

FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.15915494309189535}
"""Units of frequencies [Hz]."""


@dataclass(frozen=True)
class FrequencyColumn:
    """The frequencies of a file."""

    variable: str | None = option(None, "Name of the column or variable; recognised when not given.", min_length=1)
    unit: Literal["Hz", "kHz", "rad/s"] | None = option(None, "Unit; the file's own when not given, else Hz.")


@dataclass(frozen=True, kw_only=True)
class ElementColumns:
    """Where one element of the response stands."""

    output: str = field(metadata={"description": "Name of its output channel."})
    input: str = field(metadata={"description": "Name of its input channel."})
    file: str | None = option(None, "Its file, written as `file` above, where elements have files of their own.")
    real: str | None = option(None, "Column or variable of the real part.")
    imaginary: str | None = option(None, "The same of the imaginary part.")
    complex: str | None = option(None, "Variable of complex numbers.")
    magnitude: str | None = option(None, "Column or variable of the magnitude.")
    phase: str | None = option(None, "The same of the phase.")
    deviation: str | None = option(
        None, "The same of the standard deviation, root of E|error|^2 of the complex number, in the response's unit."
    )
    coherence: str | None = option(None, "The same of the coherence, gamma squared.")

    def problems(self) -> list[str]:
        """Finds what does not make one complex number."""
        pairs = (self.real, self.imaginary), (self.magnitude, self.phase)
        ways = [self.complex is not None, *(any(part is not None for part in pair) for pair in pairs)]
        whole = all((one is None) == (other is None) for one, other in pairs)
        if sum(ways) == 1 and whole:
            return []
        return ["S609 needs either `complex`, or `real` and `imaginary`, or `magnitude` and `phase`"]


@dataclass(frozen=True, kw_only=True)
class ResponseOptions:
    """What files of responses mean."""

    format: ResponseFormat | None = option(None, "Format of the files; recognised from the file when not given.")
    dialect: Dialect = option(Dialect(), "Format of a text table; recognised from the table when not given.")
    inputs: tuple[InputChannel, ...] = field(
        metadata={
            "description": "Inputs of the response: motor torques in the order of the joints; `variable` is the "
            "input's name in the file, units are the file's.",
            "min_length": 1,
        }
    )
    outputs: tuple[OutputChannel, ...] = field(
        metadata={"description": "Outputs; `variable` is the output's name in the file.", "min_length": 1}
    )
    frequency: FrequencyColumn = option(FrequencyColumn(), "The frequencies.")
    elements: tuple[ElementColumns, ...] = option(
        (), "Where each element stands, in tables and files of plain variables; recognised when not given."
    )
    magnitude: Literal["linear", "db"] = option("linear", "Whether magnitudes are numbers, or 20 log10 of these.")
    phase: Literal["deg", "rad"] = option("deg", "Unit of phases; a wrapped phase may stay wrapped.")
    covariance: Literal["auto", "stated", "coherence", "neighbours"] = option(
        "auto",
        "Where the error of the response comes from: deviations in the file, its coherence, or its scatter about a "
        "parabola through neighbouring lines. `auto` is the first of these that is there.",
    )
    estimator: Literal["h1", "h2", "reference"] = option(
        "h1",
        "How the response was estimated: `h1` (noise on the output), `h2` (noise on the input; brought to `h1` by the "
        "coherence), or by a reference from outside the loop (`reference`).",
    )
    averages: float | None = option(
        None,
        "Effective number of averages behind the coherence, at least 2; overlapping windows count for less than their "
        "number.",
        ge=2,
        le=1e9,
    )
    excited: Literal["alone", "together"] = option(
        "together", "Whether several inputs were excited one at a time, or together."
    )
    input_rms: tuple[float, ...] = option(
        (), "RMS of each input, for multiple coherence of inputs that were excited together and independently."
    )
    loop: Literal["open", "closed"] = option("open", "Whether a controller fed the outputs back to the inputs.")
    sampling_period_s: float | None = option(
        None,
        "Sampling period of a response between samples, whose inputs have the course that their `hold` says. Not "
        "given, the response is that of continuous time, without hold [s].",
        ge=1e-7,
    )
    measured_as: dict[str, Literal["angle", "position", "speed", "acceleration"]] = field(
        default_factory=dict,
        metadata={
            "description": "What outputs were sampled as, by name, where the file has them differentiated in the "
            "frequency domain. It decides what sampling folds down from above half its rate. Accelerations of motors "
            "and arms between samples are those of angles or positions when not given, as encoders measure these."
        },
    )
    delay_s: float = option(
        0.0,
        "Delay that the response contains, from its input to what acts on the robot, hold excluded [s].",
        ge=-1.0,
        le=1.0,
    )

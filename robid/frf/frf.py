"""The frequency response of a campaign with its structured covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity, part_of
from robid.signals.quantities import Channel, Rate, channel_names, joint_unit, response_unit, units_text

Level = Literal["odd", "even", "noise"]
_Float: TypeAlias = FloatArray | None
_Complex: TypeAlias = ComplexArray | None
LEVELS: tuple[Level, ...] = ("odd", "even", "noise")
_NEIGHBOURS = 4  # Silent lines whose mean power stands for an excited line
_RESPONSE = "configuration frequency output input"
_COVARIANCE = "configuration frequency output output"
_SILENT = "configuration silent output"
_INPUT, _OUTPUT, _ELEMENT = "configuration input", "configuration output", "configuration output input"


NO_RECORD = "There is no record: silent lines, distortion, saturation and friction cannot be looked at."
"""What responses that were measured elsewhere note."""


@dataclass(frozen=True)
class Frf:
    """Frequency responses from some channels to others, one per configuration.

    The covariance is structured: `cov(vec G) = S (input_factor (x) C_v) S`, with `vec` stacking columns, `C_v`
    the covariance of the output residual, `input_factor` the mean of `(U U^H)^-T` over realizations divided by
    their number (docs/methods, sec. 4), and `S` diagonal with the roots of `element_scale`: distortion that follows
    the inputs through a block, as friction does, gathers in some elements, which the product alone cannot hold.
    Responses that were measured elsewhere may have a variance of each element at each line: `line_scale`.
    """

    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Excited frequencies")]
    lines: Annotated[IntArray, Quantity("1", "frequency", "Their DFT lines")]
    configurations: Annotated[FloatArray, Quantity("{joint}", "configuration joint", "Arm-side joints")]
    response: Annotated[ComplexArray, Quantity("{response}", _RESPONSE, "From inputs to outputs, by their channels")]
    input_factor: Annotated[
        ComplexArray,
        Quantity("1/{per_input}^2", "configuration frequency input input", "Input factor of the covariance"),
    ]
    # Total variance of each element over that of the product, mean over the lines; 1 where there is only one
    # realization
    element_scale: Annotated[FloatArray, Quantity("1", _ELEMENT, "Element variance over that of the product")]
    total_covariance: Annotated[_Complex, Quantity("({output})^2", _COVARIANCE, "Output factor, from realizations")]
    noise_covariance: Annotated[_Complex, Quantity("({output})^2", _COVARIANCE, "Output factor, from periods")]
    total_degrees_of_freedom: float  # Complex degrees of freedom behind `total_covariance` (0 if None)
    noise_degrees_of_freedom: float  # The same for `noise_covariance`
    sensitivity: Annotated[
        ComplexArray,
        Quantity(
            "{response}",
            "configuration coefficient frequency output input",
            "Derivative with respect to relative errors of compensated torque coefficients",
        ),
    ]
    # Coefficients of the torques that compensation subtracts, as `axis_1.coulomb`
    coefficient_names: Annotated[tuple[str, ...], Quantity("1", "coefficient")]
    coefficient_relative_std: Annotated[
        FloatArray, Quantity("1", "coefficient", "Standard deviation of the relative error")
    ]
    removed_torque_rms: Annotated[FloatArray, Quantity("{input}", _INPUT, "What compensation removed")]
    sampling_period_s: float  # Sampling period of the experiment [s]
    input_channels: Annotated[tuple[Channel, ...], Quantity("1", "input", "What each input is")]
    # What each output is; motions have become accelerations where that was asked for
    output_channels: Annotated[tuple[Channel, ...], Quantity("1", "output", "What each output is")]
    # None for no distance
    coefficient_offset: Annotated[
        _Float, Quantity("1", "coefficient", "Distance of the subtracted coefficient from the file's")
    ] = None
    uncompensated_response: Annotated[
        _Complex, Quantity("{response}", _RESPONSE, "The response without compensation")
    ] = None
    # Each as `<motor>.<value>`, with the values of `robid.robot.friction.VALUES`
    law_names: Annotated[tuple[str, ...], Quantity("1", "value", "Values of the subtracted torque laws")] = ()
    law_values: Annotated[
        FloatArray, Quantity("N m; rad; rad/s; samples; 1", "value", "By their names: N m, rad, rad/s, samples or 1")
    ] = field(default_factory=lambda: np.zeros(0))
    law_std: Annotated[FloatArray, Quantity("N m; rad; rad/s; samples; 1", "value", "Their standard deviations")] = (
        field(default_factory=lambda: np.zeros(0))
    )
    # What each output was measured as; the same as `output_channels` where empty
    measured_channels: Annotated[tuple[Channel, ...], Quantity("1", "output", "What each output was measured as")] = ()
    input_hold: Literal["zoh", "band_limited"] = "zoh"  # `zoh` or `band_limited`, see `robid.signals.record.Record`
    # What the record and the estimate want the reader to know
    notes: Annotated[tuple[str, ...], Quantity("1", "note")] = field(default=())
    # NaN where neither realizations nor periods tell it
    coherence: Annotated[
        _Float, Quantity("1", "configuration frequency output", "Share of power that the response explains")
    ] = None
    silent_lines: Annotated[IntArray, Quantity("1", "silent", "Lines of the band that were not excited")] = field(
        default_factory=lambda: np.zeros(0, int)
    )
    # RMS amplitude of `Y - G U` there, see `robid.frf.distortion`
    silent_level: Annotated[_Float, Quantity("{output}", _SILENT, "RMS amplitude of the output residual there")] = None
    silent_noise: Annotated[FloatArray | None, Quantity("{output}", _SILENT, "The part of it that is noise")] = None
    # What the error of interpolating G between the lines may add; a level that does not exceed it says nothing
    silent_interpolation: Annotated[
        _Float, Quantity("{output}", _SILENT, "What interpolating the response may add")
    ] = None
    # What each realization's output residual adds to the response; they sum to nearly zero. None with one realization,
    # or where an estimator has none of its own.
    realization_error: Annotated[
        _Complex,
        Quantity("{response}", "configuration realization frequency output input", "What each realization adds to it"),
    ] = None
    # Half the complex amplitude of every input in every experiment of all realizations, compensation subtracted; its
    # power is twice its square. NaN for an experiment that there is not; None where it was not kept.
    input_amplitude: Annotated[
        _Complex, Quantity("{input}", "configuration frequency input block", "Half amplitudes in every experiment")
    ] = None
    # Mean input as recorded, without compensation. This and the next two are over all samples, and None where they are
    # unknown.
    mean_input: Annotated[_Float, Quantity("{input}", _INPUT, "Mean inputs as recorded")] = None
    mean_output: Annotated[_Float, Quantity("{measured}", _OUTPUT, "Mean outputs as measured")] = None
    motion_rms: Annotated[_Float, Quantity("{measured}", _OUTPUT, "RMS of the outputs about their means")] = None
    # Which laws were subtracted: `none`, `nominal`, `silent_lines` or `fit`; "" where it is unknown
    compensation: str = ""
    # Correlation of each line's error with those of the next lines, of estimators whose windows overlap; None where
    # lines are independent
    line_correlation: Annotated[
        _Float, Quantity("1", "configuration frequency next", "Of errors at overlapping windows")
    ] = None
    # Share of the degrees of freedom behind `covariance` left where experiments repeat each other's residual or pooled
    # lines are unequal or share what leaks; None where it is unknown
    freedom_share: Annotated[
        _Float, Quantity("1", "configuration", "Of the degrees of freedom, left by experiments that repeat")
    ] = None
    joint_units: Annotated[tuple[str, ...] | None, Quantity("1", "joint", "Units of the joints' positions")] = None
    # Lines that tell too little of an input: the response from it is interpolated there, and its variance infinite.
    # None where it is unknown.
    dropped: Annotated[
        BoolArray | None, Quantity("1", "configuration frequency input", "Lines that tell too little of an input")
    ] = None
    # Share of the time in which each input saturates, see `robid.frf.channels`. None where it is unknown.
    saturated_inputs: Annotated[_Float, Quantity("1", _INPUT, "Share of time at a limit")] = None
    saturated_outputs: Annotated[_Float, Quantity("1", _OUTPUT, "Share of time at a limit")] = None
    # Further to `element_scale`, line by line: of responses whose elements have variances of their own. None for 1
    line_scale: Annotated[_Float, Quantity("1", _RESPONSE, "Further element variance over that of the product")] = None

    def __repr__(self) -> str:
        band = f"{len(self.frequency_hz)} lines from {self.frequency_hz[0]:.4g} to {self.frequency_hz[-1]:.4g} Hz"
        channels = f"outputs {', '.join(self.output_names)}; inputs {', '.join(self.input_names)}"
        lost = 0 if self.dropped is None else int(self.dropped.any(axis=(0, 2)).sum())
        told = f"\n{lost} of the lines tell too little of an input: `response` is interpolated there" if lost else ""
        return f"frequency responses in {len(self.configurations)} configurations, {band}\n{channels}{told}"

    @property
    def known_response(self) -> ComplexArray:
        """The response (n_conf, n_freq, n_out, n_in), NaN where a line tells too little of an input.

        There `response` is interpolated, and `element_variance` infinite.
        """
        if self.dropped is None:
            return self.response
        return np.asarray(np.where(self.dropped[:, :, None], complex(np.nan, np.nan), self.response))

    @property
    def input_names(self) -> tuple[str, ...]:
        """Name of each input."""
        return channel_names(self.input_channels)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Name of each output."""
        return channel_names(self.output_channels)

    @property
    def input_unit(self) -> str:
        """Unit of the inputs: N m, or what stands for it where a torque constant is unknown."""
        return units_text(self.input_channels)

    @property
    def own_units(self) -> dict[str, str]:
        """Units that its channels and joints decide."""
        inputs, outputs = self.input_unit, units_text(self.output_channels)
        per_input = inputs if inputs.isalnum() else f"({inputs})"
        return {
            "joint": joint_unit(self.joint_units),
            "input": inputs,
            "output": outputs,
            "measured": units_text(self.measured_channels or self.output_channels),
            "per_input": per_input,
            "response": "; ".join(f"{output}/{per_input}" for output in outputs.split("; ")),
        }

    @property
    def unit(self) -> str:
        """Unit of the response; that of the first output where they differ."""
        return response_unit(units_text(self.output_channels[:1]), self.input_unit)

    @property
    def has_record(self) -> bool:
        """Whether a record is behind it; else it was measured elsewhere."""
        return NO_RECORD not in self.notes

    def select(self, configurations: Sequence[int]) -> Frf:
        """Returns the response in some of its configurations."""
        return part_of(self, "configuration", np.asarray(configurations))

    @property
    def output_rates(self) -> tuple[Rate, ...]:
        """How many times each output was differentiated before it was sampled, see `Channel.rate`; empty if unknown."""
        return tuple(channel.rate for channel in self.measured_channels)

    @property
    def hold_period_s(self) -> float | None:
        """Period for which the inputs are held [s]; None where they are not."""
        return self.sampling_period_s if self.input_hold == "zoh" else None

    @property
    def covariance(self) -> ComplexArray:
        """The output residual's covariance to use: total where known, else noise."""
        chosen = self.noise_covariance if self.total_covariance is None else self.total_covariance
        if chosen is None:
            shape = (*self.response.shape[:3], self.response.shape[2])
            return np.zeros(shape, complex)
        return chosen

    def element_variance(self, *, noise_only: bool = False) -> FloatArray:
        """Variance of each element (n_conf, n_freq, n_out, n_in), `E|G_hat - G|^2`."""
        chosen = self.noise_covariance if noise_only else self.covariance
        if chosen is None:
            return np.zeros(self.response.shape)
        # The diagonal of `input_factor (x) C_v`: element (o, i) has C_v[o, o] times the factor's [i, i].
        rows = np.real(np.diagonal(chosen, axis1=-2, axis2=-1))
        columns = np.real(np.diagonal(self.input_factor, axis1=-2, axis2=-1))
        scale = 1.0 if noise_only else self.scale
        variance = np.asarray(rows[..., :, None] * columns[..., None, :] * scale)
        return variance if self.dropped is None else np.where(self.dropped[:, :, None], np.inf, variance)

    @property
    def scale(self) -> FloatArray:
        """Variance of each element over that of the product (n_conf, n_freq or 1, n_out, n_in)."""
        own = self.element_scale[:, None]
        return own if self.line_scale is None else own * self.line_scale

    @property
    def degrees_of_freedom(self) -> float:
        """Complex degrees of freedom behind `covariance`."""
        share = 1.0 if self.freedom_share is None else float(np.mean(self.freedom_share))
        counted = self.noise_degrees_of_freedom if self.total_covariance is None else self.total_degrees_of_freedom
        return counted * share

    def full_covariance(self, configuration: int) -> ComplexArray:
        """Structured covariance of `vec G`, columns stacked, in one configuration (n_freq, n_out n_in, n_out n_in)."""
        left, right = self.input_factor[configuration], self.covariance[configuration]
        size = left.shape[1] * right.shape[1]
        # vec stacks columns: the input is the slow index, the output the fast one, as in the Kronecker product.
        product = np.einsum("fij,fop->fiojp", left, right).reshape(-1, size, size)
        # In the order of vec: the transpose of each line's scale, row by row.
        root = np.sqrt(self.scale[configuration].swapaxes(-1, -2).reshape(-1, size))
        return np.asarray(product * root[:, :, None] * root[:, None, :])

    def error_radius(self, level: float) -> FloatArray:
        """Radius that an element's error exceeds with probability 1 - level (n_conf, n_freq, n_out, n_in).

        The error is circular complex normal and its variance estimated: their ratio is F distributed with 2 and
        2 nu degrees of freedom, whose quantile is `nu ((1 - level)^(-1/nu) - 1)`.
        """
        deviation = np.sqrt(self.element_variance())
        known = np.isfinite(deviation)
        return np.asarray(np.multiply(deviation, self.radius_factor(level), out=deviation.copy(), where=known))

    def radius_factor(self, level: float) -> float:
        """`error_radius` over an element's standard deviation; 0 where no variance is known."""
        # F(2, 2 nu) has the closed quantile nu ((1 - p)^(-1/nu) - 1); expm1 and log1p keep its digits for large nu.
        freedom = self.degrees_of_freedom
        return float(np.sqrt(freedom * np.expm1(-np.log1p(-level) / freedom))) if freedom > 0 else 0.0

    @property
    def signal_to_noise(self) -> FloatArray | None:
        """Power of each element over the variance that noise gives it (n_conf, n_freq, n_out, n_in), or None."""
        if self.noise_covariance is None:
            return None
        variance = self.element_variance(noise_only=True)
        square = np.abs(self.response) ** 2
        # Periods without any noise, as of a simulation, have a variance of nothing.
        return np.asarray(square / np.maximum(variance, 1e-300 * square + np.finfo(float).tiny))

    def residual_level(self, kind: Level) -> FloatArray | None:
        """Level of the silent lines, brought to the excited lines: mean power of the nearest ones.

        Args:
            kind: Level of the odd or the even lines, noise included: odd nonlinearities show at odd lines, even
                ones at even lines. Or noise alone, of both.

        Returns:
            Amplitude of the output residual (n_conf, n_freq, n_out) [unit of the output]; None where there are no such
            lines.
        """
        chosen = (self.silent_lines % 2 == (kind == "odd")) | (kind == "noise")
        amplitude = self.silent_noise if kind == "noise" else self.silent_level
        if amplitude is None or not chosen.any():
            return None
        # Distortion is smooth over frequency, so that the nearest silent lines stand for an excited one.
        distance = np.abs(self.silent_lines[chosen] - self.lines[:, None])
        nearest = np.argsort(distance, axis=1, kind="stable")[:, :_NEIGHBOURS]
        return np.asarray(np.sqrt((amplitude[:, chosen][:, nearest] ** 2).mean(axis=2)))

    def response_level(self, kind: Level) -> FloatArray | None:
        """Deviation of each element (n_conf, n_freq, n_out, n_in) that residuals of `residual_level` give."""
        level = self.residual_level(kind)
        if level is None:
            return None
        columns = np.real(np.diagonal(self.input_factor, axis1=-2, axis2=-1))
        return np.asarray(level[..., :, None] * np.sqrt(columns)[..., None, :])

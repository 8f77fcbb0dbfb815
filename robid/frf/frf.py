"""The frequency response of a campaign with its structured covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.signals.quantities import Channel, Rate, channel_names, response_unit, units_text

Level = Literal["odd", "even", "noise"]
LEVELS: tuple[Level, ...] = ("odd", "even", "noise")

_NEIGHBOURS = 4
"""Silent lines whose mean power stands for an excited line."""

CONFIGURATION_WISE = (
    "configurations",
    "response",
    "input_factor",
    "element_scale",
    "realization_error",
    "total_covariance",
    "noise_covariance",
    "sensitivity",
    "removed_torque_rms",
    "coherence",
    "silent_level",
    "silent_noise",
    "silent_interpolation",
    "uncompensated_response",
    "input_amplitude",
    "mean_input",
    "mean_output",
    "motion_rms",
    "line_correlation",
    "freedom_share",
    "dropped",
    "saturated_inputs",
    "saturated_outputs",
)
"""Fields of an `Frf` whose first axis is the configuration."""


@dataclass(frozen=True)
class Frf:
    """Frequency responses from some channels to others, one per configuration.

    The covariance is structured: `cov(vec G) = S (input_factor (x) C_v) S`, with `vec` stacking columns, `C_v`
    the covariance of the output residual, `input_factor` the mean of `(U U^H)^-T` over realizations divided by
    their number (docs/methods, sec. 4), and `S` diagonal with the roots of `element_scale`: distortion that follows
    the inputs through a block, as friction does, gathers in some elements, which the product alone cannot hold.

    Attributes:
        frequency_hz (n_freq,): Excited frequencies [Hz].
        lines (n_freq,): Their DFT lines.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].
        response (n_conf, n_freq, n_out, n_in): Frequency response [unit of the output over that of the input].
        input_factor (n_conf, n_freq, n_in, n_in): See above [inverse square of the inputs' unit].
        element_scale (n_conf, n_out, n_in): Total variance of each element over that of the product, mean over
            the lines; 1 where there is only one realization.
        total_covariance (n_conf, n_freq, n_out, n_out): `C_v` from realizations, or None when there is
            only one [square of the outputs' unit].
        noise_covariance (n_conf, n_freq, n_out, n_out): `C_v` from periods, or None when there is only
            one [square of the outputs' unit].
        realization_error (n_conf, n_real, n_freq, n_out, n_in): What each realization's output residual adds to
            the response; they sum to nearly zero. None with one realization, or where an estimator has none of its own.
        total_degrees_of_freedom: Complex degrees of freedom behind `total_covariance` (0 if None).
        noise_degrees_of_freedom: The same for `noise_covariance`.
        sensitivity (n_conf, n_coef, n_freq, n_out, n_in): Derivative of `response` with respect to the
            relative error of each compensated torque coefficient; n_coef may be 0.
        coefficient_names: Name of each compensated coefficient.
        coefficient_relative_std (n_coef,): Standard deviation of its relative error, from the robot file.
        removed_torque_rms (n_conf, n_in): RMS of the torque that compensation removed [N m].
        coefficient_offset (n_coef,): How far each coefficient, as it was subtracted, is from the robot file's; None
            for no distance.
        uncompensated_response (n_conf, n_freq, n_out, n_in): The response without compensation, or None.
        law_names: Name of each value of the subtracted torque laws, `<motor>.<value>`.
        law_values (n_law,): The values, in the units of `robid.robot.friction.VALUES`.
        law_std (n_law,): Their standard deviations.
        sampling_period_s: Sampling period of the experiment [s].
        input_channels: What each input is: name, quantity, unit and side.
        output_channels: What each output is; motions have become accelerations where that was asked for.
        measured_channels: What each output was measured as; the same as `output_channels` where empty.
        input_hold: `zoh` or `band_limited`, see `robid.signals.record.Record`.
        notes: What the estimator wants the reader to know.
        coherence (n_conf, n_freq, n_out): Share of each output's power that the response explains.
        silent_lines (n_silent,): Lines of the band that were not excited.
        silent_level (n_conf, n_silent, n_out): RMS amplitude of `Y - G U` there, see `robid.frf.distortion`
            [unit of the output].
        silent_noise (n_conf, n_silent, n_out): The part of it that is noise, or None with a single period.
        silent_interpolation (n_conf, n_silent, n_out): What the error of interpolating G between the lines may add;
            a level that does not exceed it says nothing.
        input_amplitude (n_conf, n_freq, n_in, n_block): Half the complex amplitude of every input in every
            experiment of all realizations, compensation subtracted; its power is twice its square. NaN for an
            experiment that there is not; None where it was not kept [unit of the input].
        mean_input (n_conf, n_in): Mean input as recorded, without compensation [unit of the input]. This and the next
            two are over all samples, and None where they are unknown.
        mean_output (n_conf, n_out): Mean output as it was measured, in that unit.
        motion_rms (n_conf, n_out): RMS of the output as it was measured about its mean, in that unit.
        compensation: Which laws were subtracted: `none`, `nominal`, `silent_lines` or `fit`; "" where it is unknown.
        line_correlation (n_conf, n_freq, n_next): Correlation of each line's error with those of the next lines, of
            estimators whose windows overlap; None where lines are independent.
        freedom_share (n_conf,): Share of the degrees of freedom behind `covariance` left where experiments repeat each
            other's residual or pooled lines are unequal or share what leaks; None where it is unknown.
        dropped (n_conf, n_freq, n_in): Lines that tell too little of an input: the response from it is interpolated
            there, and its variance infinite. None where it is unknown.
        saturated_inputs (n_conf, n_in): Share of the time in which each input saturates, see `robid.frf.saturation`.
            None where it is unknown.
        saturated_outputs (n_conf, n_out): The same of each output.
    """

    frequency_hz: FloatArray
    lines: IntArray
    configurations: FloatArray
    response: ComplexArray
    input_factor: ComplexArray
    element_scale: FloatArray
    total_covariance: ComplexArray | None
    noise_covariance: ComplexArray | None
    total_degrees_of_freedom: float
    noise_degrees_of_freedom: float
    sensitivity: ComplexArray
    coefficient_names: tuple[str, ...]
    coefficient_relative_std: FloatArray
    removed_torque_rms: FloatArray
    sampling_period_s: float
    input_channels: tuple[Channel, ...]
    output_channels: tuple[Channel, ...]
    coefficient_offset: FloatArray | None = None
    uncompensated_response: ComplexArray | None = None
    law_names: tuple[str, ...] = ()
    law_values: FloatArray = field(default_factory=lambda: np.zeros(0))
    law_std: FloatArray = field(default_factory=lambda: np.zeros(0))
    measured_channels: tuple[Channel, ...] = ()
    input_hold: Literal["zoh", "band_limited"] = "zoh"
    notes: tuple[str, ...] = field(default=())
    coherence: FloatArray | None = None
    silent_lines: IntArray = field(default_factory=lambda: np.zeros(0, int))
    silent_level: FloatArray | None = None
    silent_noise: FloatArray | None = None
    silent_interpolation: FloatArray | None = None
    realization_error: ComplexArray | None = None
    input_amplitude: ComplexArray | None = None
    mean_input: FloatArray | None = None
    mean_output: FloatArray | None = None
    motion_rms: FloatArray | None = None
    compensation: str = ""
    line_correlation: FloatArray | None = None
    freedom_share: FloatArray | None = None
    joint_units: tuple[str, ...] | None = None
    dropped: BoolArray | None = None
    saturated_inputs: FloatArray | None = None
    saturated_outputs: FloatArray | None = None

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
    def unit(self) -> str:
        """Unit of the response; that of the first output where they differ."""
        return response_unit(units_text(self.output_channels[:1]), self.input_unit)

    def select(self, configurations: Sequence[int]) -> Frf:
        """Returns the response in some of its configurations."""
        chosen = np.asarray(configurations)
        held: dict[str, Any] = {name: getattr(self, name) for name in CONFIGURATION_WISE}
        part: dict[str, Any] = {name: None if value is None else value[chosen] for name, value in held.items()}
        return replace(self, **part)

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
        rows = np.real(np.diagonal(chosen, axis1=-2, axis2=-1))
        columns = np.real(np.diagonal(self.input_factor, axis1=-2, axis2=-1))
        scale = 1.0 if noise_only else self.element_scale[:, None]
        variance = np.asarray(rows[..., :, None] * columns[..., None, :] * scale)
        return variance if self.dropped is None else np.where(self.dropped[:, :, None], np.inf, variance)

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
        product = np.einsum("fij,fop->fiojp", left, right).reshape(-1, size, size)
        root = np.sqrt(self.element_scale[configuration].T.ravel())
        return np.asarray(product * np.outer(root, root))

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

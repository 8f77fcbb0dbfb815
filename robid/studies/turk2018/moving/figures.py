"""What a model and the true drive miss of a record in which the slide travels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.spectra import output_factor
from robid.models.lpv.fit.solution import LpvSolution
from robid.signals.record import Record
from robid.simulate.truth import TrueRobot
from robid.studies.turk2018.moving.check import position_output
from robid.studies.turk2018.moving.frozen import drive_amplitudes, freeze_drive
from robid.studies.turk2018.moving.prediction import (
    ErrorParts,
    deviation,
    error_excess,
    measured_amplitudes,
    simulated_amplitudes,
    split_errors,
)


@dataclass(frozen=True)
class Travelled:
    """Amplitudes at the excited lines of a travelling slide.

    Attributes:
        frequency_hz (n_freq,): Excited lines.
        outputs: Names of the outputs.
        units: Their units, as they were measured.
        measured (n_period, n_freq, n_out): Of each period.
        fitted (n_period, n_freq, n_out): Of the fitted model, along the measured torque and position.
        unmoved (n_period, n_freq, n_out): The same, told that the slide stands where it is on average.
        true (n_period, n_freq, n_out): Of the true drive, linearised wherever it is.
    """

    frequency_hz: FloatArray
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    measured: ComplexArray
    fitted: ComplexArray
    unmoved: ComplexArray
    true: ComplexArray

    @property
    def omega_squared(self) -> FloatArray:
        """What turns amplitudes into those of accelerations, but for the sign (n_freq, 1)."""
        return np.asarray((2 * np.pi * self.frequency_hz[:, None]) ** 2)

    def error(self, modelled: ComplexArray, *, accelerations: bool = False) -> ErrorParts:
        """Returns the error of a model's amplitudes (n_period, n_freq, n_out)."""
        return split_errors((self.measured - modelled) * (self.omega_squared if accelerations else 1.0))

    def excess(self, modelled: ComplexArray, *, accelerations: bool = False) -> FloatArray:
        """Returns by how much a model's error exceeds the true drive's (n_out,), as a share of that."""
        own, true = (self.error(each, accelerations=accelerations) for each in (modelled, self.true))
        return error_excess(own, true)


def travel(solution: LpvSolution, record: Record, truth: TrueRobot) -> Travelled:
    """Runs a model and the true drive along a record of one configuration and experiment.

    What an unstable model answers is not a number.

    Raises:
        DataError: If the record lacks a channel, or the slide leaves the range of the model.
    """
    ports, names = solution.ports, record.output_names
    place = position_output(ports.scheduling[0])
    missing = [name for name in (*ports.outputs, place) if name not in names]
    if missing:
        message = f"the record of the travelling slide lacks the output `{missing[0]}`"
        raise DataError(message, remedy="add it to the campaign's `outputs`")
    chosen, lines = [names.index(name) for name in ports.outputs], record.excited_lines
    torque, motion = record.inputs[0, 0, 0], record.outputs[0, 0, 0]
    position = motion[..., names.index(place)] + record.output_offset[0, names.index(place)]
    scheduling = position[..., None]
    fitted, unmoved = (
        _modelled(solution, record, each) for each in (scheduling, np.full_like(scheduling, position.mean()))
    )
    drive = freeze_drive(truth, ports.outputs, position.min(), position.max(), record.sampling_period_s)
    return Travelled(
        frequency_hz=record.frequency_hz,
        outputs=ports.outputs,
        units=tuple(record.output_channels[index].unit for index in chosen),
        measured=measured_amplitudes(motion[..., chosen], lines),
        fitted=fitted,
        unmoved=unmoved,
        true=drive_amplitudes(drive, torque[..., 0], position, lines),
    )


def travel_figures(travelled: Travelled, fixed: FloatArray) -> dict[str, float]:
    """Returns what the study says of the travelling slide.

    Args:
        travelled: Its amplitudes.
        fixed (n_out,): What `total_over_noise` says of the slide at one position.
    """
    fitted, true = travelled.error(travelled.fitted), travelled.error(travelled.true)
    excess, signal = travelled.excess(travelled.fitted), deviation(split_errors(travelled.measured).total)
    columns = {
        "ratio_mismatch_percent": 100 * excess,
        "acceleration_mismatch_percent": 100 * travelled.excess(travelled.fitted, accelerations=True),
        "unmoved_mismatch_percent": 100 * travelled.excess(travelled.unmoved),
        "error_percent": 100 * deviation(fitted.total) / signal,
        "true_error_percent": 100 * deviation(true.total) / signal,
        "error_over_stochastic": fitted.over_stochastic,
        "true_error_over_stochastic": true.over_stochastic,
        "total_over_noise": fixed,
    }
    return {"global.ratio_mismatch_percent": 100 * float(excess.max())} | {
        f"global.{key}.{name}": float(value)
        for key, values in columns.items()
        for name, value in zip(travelled.outputs, values, strict=True)
    }


def uncompensated_figures(travelled: Travelled) -> dict[str, float]:
    """Returns by how much a model with friction in it misses more than the true drive, per output."""
    excess = 100 * travelled.excess(travelled.fitted)
    named = zip(travelled.outputs, excess, strict=True)
    return {f"global.uncompensated_mismatch_percent.{name}": float(value) for name, value in named}


def total_over_noise(frf: Frf, outputs: tuple[str, ...], periods: int) -> FloatArray:
    """Root of the mean over the lines of a response's total variance over that of one period's noise (n_out,).

    Without distortion it is `1 / sqrt(periods)`.

    Args:
        frf: Responses at one position to one input, from several realizations.
        outputs: Names of the outputs.
        periods: Periods of each realization.

    Raises:
        DataError: If the response lacks an output, or a variance is unknown.

    Source:
        Turk et al. (2018), eq. 20.
    """
    names = [channel.name for channel in frf.output_channels]
    if frf.total_covariance is None or frf.noise_covariance is None or not set(outputs) <= set(names):
        message = "the response at one position lacks an output of the model, or a variance"
        raise DataError(message, remedy="ask for the model's outputs, several realizations and several periods")
    total, noise = (frf.element_variance(noise_only=only)[0, :, :, 0] for only in (False, True))
    return np.asarray(np.sqrt(np.mean(total / (periods * noise), axis=0))[[names.index(name) for name in outputs]])


def _modelled(solution: LpvSolution, record: Record, scheduling: FloatArray) -> ComplexArray:
    """What a model makes of a record's inputs, as amplitudes of what was measured."""
    names, ports = record.output_names, solution.ports
    lines, chosen = record.excited_lines, [names.index(name) for name in ports.outputs]
    if not solution.largest_pole < 1:
        return np.full((len(scheduling), len(lines), len(chosen)), np.nan, complex)
    own = simulated_amplitudes(
        solution.core_model, solution.core.integrators, record.inputs[0, 0, 0], scheduling, lines
    )  # fmt: skip
    units = [record.output_channels[index].unit for index in chosen]
    as_measured = [unit == modelled for unit, modelled in zip(units, ports.output_units, strict=True)]
    return np.asarray(own / np.where(as_measured, 1.0, output_factor(record, lines)[:, chosen]))

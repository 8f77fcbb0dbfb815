"""The estimate of a frequency response with its covariance, from the record of one configuration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.blocks import ESTIMATORS, BlockEstimate, place_of, solvable_lines
from robid.frf.channels import channel_levels, limit_shares, response_channels, to_accelerations
from robid.frf.checks import RecordFinding, check_record, fed_back, finding_notes, refuse_faults
from robid.frf.covariance import (
    element_scale,
    freedom_share,
    noise_covariance,
    total_covariance,
)
from robid.frf.distortion import (
    FEWEST,
    completed,
    explained_coherence,
    hidden_inputs,
    lost_inputs,
    multiple_coherence,
    require_lines,
    silent_levels,
    weak_inputs,
)
from robid.frf.frf import Frf
from robid.frf.friction import coefficients
from robid.frf.local import local_fit
from robid.frf.options import EstimateOptions
from robid.frf.period_noise import FEW_PERIODS, FEWEST_SAMPLES, exceeds, period_noise
from robid.frf.reading import Spectra, Windows, read_spectra, silent_of
from robid.frf.spectra import Blocks
from robid.frf.steadiness import Steadiness, measure_steadiness, steadiness_findings, steadiness_notes
from robid.robot.friction import TorqueLaw
from robid.signals.record import Record

UNSTEADY = frozenset({"local", "robust_local"})  # Estimators that need no period to repeat another one


@dataclass(frozen=True)
class _Found:
    """An estimate, its output residual's covariance, and the removed torque in the order of its weights."""

    estimate: BlockEstimate
    element_scale: FloatArray
    total: ComplexArray | None
    total_freedom: float
    derivative: ComplexArray
    realization_error: ComplexArray | None = None
    line_correlation: FloatArray | None = None
    freedom_share: float = 1.0
    hidden: BoolArray | None = None

    def scale(self, record: Record, told: BoolArray) -> FloatArray:
        """Element scale (n_out, n_in) from the lines that tell of each input (n_freq, n_in) alone."""
        if self.realization_error is None:
            return self.element_scale
        factor, n_exp = self.estimate.input_factor, record.inputs.shape[2]
        return element_scale(self.realization_error, factor, self.total, n_exp, told)


def estimate_frf(
    record: Record, options: EstimateOptions, laws: tuple[TorqueLaw, ...] | None = None, delay_s: float = 0.0
) -> Frf:
    """Estimates the frequency response of one configuration with its covariance; the configuration axis is kept.

    Args:
        record: Record of a single configuration.
        options: Estimator, compensation and pooling.
        laws: Torque laws per motor to subtract, where there is compensation: the robot file's or identified ones.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Raises:
        DataError: If an experiment block does not excite every input, the data are not finite, or their time base
            is wrong, see `robid.frf.checks`.

    Source:
        Wernholt and Moberg (2008), eq. 2; docs/methods, sec. 4.
    """
    record.require_periods("A frequency response")
    if options.compensation == "none" or laws is None or all(law.is_zero for law in laws):
        laws = None
    spectra = read_spectra(record, options, laws, delay_s)
    limits = limit_shares(record)
    findings = check_record(record, limits, periodic=options.estimator != "local")
    # Periods that differ in size look like jitter, too: the steadiness below tells which it is.
    if any(one.fatal and one.kind != "jitter" for one in findings):
        refuse_faults(record, findings)
    found, solved = _found(record, spectra, options)
    steady = _steadiness(record, spectra.at(solved), found, options)
    findings = _with_steadiness(record, findings, steady)
    frf = _frf(record, record.excited_lines[solved], spectra.at(solved), found, options, laws, steady)
    frf = replace(frf, **limits.levels(len(record.input_names)))
    frf, lost = _without_lost(frf, record, spectra, found, solved, options)
    told = () if steady is None else steadiness_notes(steady, record)
    return replace(frf, notes=(*frf.notes, *told, *finding_notes(record, [*findings, *lost, *fed_back(record, frf)])))


def _with_steadiness(record: Record, findings: list[RecordFinding], steady: Steadiness | None) -> list[RecordFinding]:
    """Findings with what the periods differ by; refuses what is fatal."""
    findings = [*(() if steady is None else steadiness_findings(steady, record)), *findings]
    if any(one.fatal and one.kind == "unsteady" for one in findings):
        findings = [one for one in findings if one.kind != "jitter"]
    refuse_faults(record, findings)
    return findings


def _without_lost(
    frf: Frf, record: Record, spectra: Spectra, found: _Found, solved: BoolArray, options: EstimateOptions
) -> tuple[Frf, list[RecordFinding]]:
    """A response at all lines, those that tell too little left out, and what is said of them."""
    findings: list[RecordFinding] = []
    dropped = np.ones((len(solved), len(record.input_names)), bool)
    hidden = np.zeros_like(dropped)
    dropped[solved] = weak_inputs(frf.response[0], frf.element_variance()[0], options.weak_line_std)
    if found.hidden is not None:
        hidden[solved] = found.hidden
    # Lines that look like the transient are told apart from those that drown: the remedies differ.
    weak, dropped = dropped & ~hidden, dropped | hidden
    if hidden.any():
        findings.append(_hidden(record, spectra, hidden, ~dropped))
    require_lines(~dropped, record.frequency_hz, options.weak_line_std, place_of(record))
    frf = replace(frf, dropped=dropped[None])
    if dropped.any():
        frf = replace(frf, element_scale=found.scale(record, ~dropped[solved])[None])
        amplitude = spectra.amplitude(record)
        reach = 0 if spectra.windows is None else spectra.windows.reach
        frf = completed(frf, dropped, record.excited_lines, record.frequency_hz, amplitude, reach)
    if weak.any():
        what = lost_inputs(weak, record.frequency_hz, record.input_names)
        findings.append(
            RecordFinding("weak", what, "its responses there are interpolated and left out of fits", fatal=False)
        )
    return frf, findings


def _hidden(record: Record, spectra: Spectra, hidden: BoolArray, told: BoolArray) -> RecordFinding:
    """What is said of lines whose response looks like a transient; refuses a record that has hardly any other."""
    needed_s = None
    if record.segments and spectra.windows is not None:
        needed_s = 2 * record.period_s / (spectra.windows.index.shape[1] - 1)
    what, remedy = hidden_inputs(hidden, record.frequency_hz, record.input_names, needed_s)
    if told.sum(axis=0).max() < min(FEWEST, len(told)):
        raise DataError(what, where=place_of(record), remedy=remedy)
    return RecordFinding("weak", what, f"the lines are left out until you {remedy}", fatal=False)


def _steadiness(record: Record, spectra: Spectra, found: _Found, options: EstimateOptions) -> Steadiness | None:
    """How the periods differ, for estimators that average them."""
    if options.estimator in UNSTEADY:
        return None
    accelerations = to_accelerations(record, options)
    return measure_steadiness(spectra.at_lines, found.estimate.response, record, accelerations=accelerations)


def _found(record: Record, spectra: Spectra, options: EstimateOptions) -> tuple[_Found, BoolArray]:
    """An estimate at the lines that can be solved, and which of all they are (n_freq,)."""
    if spectra.windows is not None:
        return _by_windows(spectra, spectra.windows, options)
    solved = solvable_lines(record, spectra.blocks, options.estimator)
    return _by_blocks(spectra.at(solved), options), solved


def _frf(
    record: Record,
    lines: IntArray,
    spectra: Spectra,
    found: _Found,
    options: EstimateOptions,
    laws: tuple[TorqueLaw, ...] | None,
    steady: Steadiness | None,
) -> Frf:
    """The response at the lines that could be solved."""
    noise, noise_freedom, noise_share = _noise(record, spectra.at_lines, found.estimate.response, options, steady)
    arrays: dict[str, Any] = _arrays(lines, spectra, found, noise)
    arrays["input_amplitude"] = spectra.amplitude(record)
    arrays["uncompensated_response"] = None if laws is None else _uncompensated(spectra, options)
    rows: dict[str, Any] = {name: None if array is None else array[None] for name, array in arrays.items()}
    return Frf(
        **rows,
        **coefficients(record, laws, found.estimate, found.derivative),
        **channel_levels(record),
        frequency_hz=lines / record.period_s,
        lines=lines,
        configurations=record.require_periods("A frequency response"),
        total_degrees_of_freedom=found.total_freedom,
        noise_degrees_of_freedom=noise_freedom,
        sampling_period_s=record.sampling_period_s,
        input_channels=record.input_channels,
        output_channels=response_channels(record, options),
        measured_channels=record.output_channels,
        input_hold=record.input_hold,
        joint_units=record.joint_units,
        notes=(*record.notes, *_notes(found.total, record, spectra.windows)),
        silent_lines=spectra.silent.lines,
        compensation=_used(laws, options),
        freedom_share=np.array([noise_share if found.total is None else found.freedom_share]),
    )


def _arrays(lines: IntArray, spectra: Spectra, found: _Found, noise: ComplexArray | None) -> dict[str, Any]:
    """Fields of an `Frf` that have a configuration axis, without it."""
    response = found.estimate.response
    silent = silent_levels(spectra.silent, lines, response)
    return {
        "response": response,
        "input_factor": found.estimate.input_factor,
        "element_scale": found.element_scale,
        "realization_error": found.realization_error,
        "total_covariance": found.total,
        "noise_covariance": noise,
        "line_correlation": found.line_correlation,
        "removed_torque_rms": _rms(spectra.removed_torque),
        "coherence": _coherence(spectra, response, noise if found.total is None else found.total),
        **{f"silent_{name}": level for name, level in silent._asdict().items()},
    }


def _noise(
    record: Record, blocks: Blocks, response: ComplexArray, options: EstimateOptions, steady: Steadiness | None
) -> tuple[ComplexArray | None, float, float]:
    """Covariance of the output residual that noise causes, its degrees of freedom and the share of them that is left.

    The scatter of the periods, or their spectrum where they are few, differ by nothing but noise, and scatter no more
    than it says: what is left of a transient is no spectrum's, and is in the mean.
    """
    moved = blocks.output_scatter - response @ blocks.input_scatter
    scatter, freedom = noise_covariance(moved, blocks.scatter_freedom, options.pooled_lines)
    if steady is None or scatter is None or not steady.is_noise or record.inputs.shape[3] > FEW_PERIODS:
        return scatter, freedom, 1.0
    if record.inputs.shape[4] < FEWEST_SAMPLES:
        return scatter, freedom, 1.0
    accelerations = to_accelerations(record, options)
    found = period_noise(record, blocks.lines, response, options.pooled_lines, accelerations=accelerations)
    each, single = noise_covariance(moved, blocks.scatter_freedom, 1)
    # The spectrum of the noise holds only where the periods scatter no more than it says.
    beyond = each is not None and exceeds(each, found.covariance, single)
    return scatter if beyond else found.covariance, found.freedom, found.share


def _coherence(spectra: Spectra, response: ComplexArray, covariance: ComplexArray | None) -> FloatArray:
    """Multiple coherence (n_freq, n_out); of a local model without the transient."""
    if spectra.windows is None or covariance is None:
        return multiple_coherence(spectra.at_lines.outputs, covariance)
    return explained_coherence(response, spectra.windows.rows(spectra.blocks.inputs), covariance)


def _used(laws: tuple[TorqueLaw, ...] | None, options: EstimateOptions) -> str:
    """Which compensation some laws are."""
    if laws is None:
        return "none"
    if options.friction_fit is not None:
        return "fit"
    return "silent_lines" if any(law.identified_std is not None for law in laws) else "nominal"


def _by_blocks(spectra: Spectra, options: EstimateOptions) -> _Found:
    """An estimate whose blocks each excite every input; its covariance is that of the realizations."""
    blocks = spectra.blocks
    # Residuals of the period averages: V_m = Y_m - G U_m holds noise and distortion alike.
    estimate = ESTIMATORS[options.estimator](blocks)
    residual = blocks.outputs - estimate.response @ blocks.inputs
    total, freedom = total_covariance(residual, blocks.inputs.shape[2], options.pooled_lines)
    errors = residual @ estimate.weights
    scale = element_scale(errors, estimate.input_factor, total, residual.shape[-1])
    each = None if total is None else errors
    share = freedom_share(residual, freedom)
    return _Found(estimate, scale, total, freedom, spectra.removed.derivative, each, freedom_share=share)


def _by_windows(spectra: Spectra, windows: Windows, options: EstimateOptions) -> tuple[_Found, BoolArray]:
    """An estimate over neighbouring lines, whose covariance is that of the local fits' residuals; where it holds."""
    fit = local_fit(spectra.blocks, windows, options)
    derivative = windows.at(fit.determined).joined(spectra.removed.derivative)
    shared = fit.line_correlation if fit.line_correlation.size else None
    found = _Found(
        fit, fit.element_scale, fit.covariance, fit.freedom, derivative, line_correlation=shared, hidden=fit.hidden
    )
    return found, fit.determined


def _uncompensated(spectra: Spectra, options: EstimateOptions) -> ComplexArray:
    """The response (n_freq, n_out, n_in) of the torque as recorded."""
    measured = replace(spectra.blocks, inputs=spectra.blocks.inputs + spectra.removed.torque)
    if spectra.windows is None:
        return ESTIMATORS[options.estimator](measured).response
    fit = local_fit(measured, spectra.windows, options)
    nearest = np.abs(np.arange(len(fit.determined))[:, None] - np.flatnonzero(fit.determined)).argmin(axis=1)
    return np.asarray(fit.response[nearest])


def _rms(torque: ComplexArray) -> FloatArray:
    """RMS of each motor over realizations and experiments (n_in,), from its complex amplitudes."""
    return np.asarray(np.sqrt(2 * (np.abs(torque) ** 2).sum(axis=1).mean(axis=(0, -1))))


def _notes(total: ComplexArray | None, record: Record, windows: Windows | None) -> tuple[str, ...]:
    """What the data cannot tell."""
    notes, excited = [], record.excited_lines
    if record.is_arbitrary and windows is not None and windows.index.shape[1] > record.segments + 1:
        width_hz = (windows.index.shape[1] - 1) / record.period_s
        notes.append(
            f"The log is short for its resolution of {record.segments / record.period_s:.3g} Hz: each frequency's"
            f" response is that of {width_hz:.3g} Hz around it."
        )
    if total is None:
        notes.append("One realization: the covariance contains noise only, no distortion by nonlinearities.")
    if not silent_of(record).size:
        notes.append(
            "Every line of the band is excited: distortion by nonlinearities cannot be distinguished from the response."
        )
    elif not np.all(excited % 2):
        notes.append("Even lines are excited: distortion at silent lines does not tell odd from even nonlinearities.")
    return tuple(notes)

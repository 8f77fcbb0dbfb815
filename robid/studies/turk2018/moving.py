"""The model while the slide moves, and the true drive, linearised wherever it is: a linear model can reach no more.

Both run along a record; what they miss of it stands beside the paper's figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.spectra import line_amplitudes, output_factor
from robid.models.lpv.files import solution_from_artifact
from robid.models.lpv.fit.model import LpvModel, simulate_lpv, unit_circle
from robid.models.lpv.fit.solution import LpvSolution
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, significant
from robid.report.section import Beside, Figure, Notes, Section, Table
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.robot.statespace import discretise, state_space
from robid.signals.record import Record
from robid.simulate.truth import TrueRobot, recorded_torque_factor, with_imperfections
from robid.studies.experiments import Further, fit_outputs, paper_figures
from robid.studies.page import Asked, PartFound, figure
from robid.studies.settings.parts import TravelCase, position_output
from robid.studies.study import Part, Results

_POINTS = 401
_RESTING = 1e-9  # rad, or m


@dataclass(frozen=True)
class FrozenDrive:
    """Sampled models on a grid of positions, in the same states: angle, deflections, their rates, torques waiting."""

    position: FloatArray  # (n_point,) the grid, evenly spaced [rad, or m]
    A: FloatArray  # (n_point, n_state, n_state) system matrices
    B: FloatArray  # (n_point, n_state) input vectors, of the torque as it was recorded
    C: FloatArray  # (n_point, n_out, n_state) output matrices, of angles and positions
    sampling_period_s: float


def freeze_drive(
    truth: TrueRobot, outputs: tuple[str, ...], lower: float, upper: float, sampling_period_s: float
) -> FrozenDrive:
    """Linearises a simulated drive of one joint at positions all over a range [rad, or m].

    Of its friction only the viscous part counts. Outputs are named as in `robid.robot.linearize.linearize`; the period
    is that of the held torque and of these.

    Raises:
        DataError: If the drive has several joints, or rests under load: what it rests at would move with it.
    """
    robot = with_imperfections(truth.robot, truth.imperfections)
    motors = tuple(joint.name for joint in robot.joints)
    model, grid = build_model(robot), np.linspace(lower, upper, _POINTS)
    rest = solve_statics(model, grid[:, None]) if len(motors) == 1 else None
    if rest is None or np.abs(rest.deflection).max(initial=0.0) > _RESTING:
        message = "D223 a moving drive is frozen only with a single joint that rests without load"
        raise DataError(message, where="campaign of the travelling slide", remedy="leave `global` out of the study")
    linear = linearize(model, rest, outputs)
    parameters, springs = nominal_parameters(robot, linear, truth.delay_s), tuple(s.name for s in robot.springs)
    continuous = (state_space(linear, parameters, index, motors, springs, outputs) for index in range(_POINTS))
    sampled = [discretise(one, sampling_period_s, truth.delay_s) for one in continuous]
    factor = float(recorded_torque_factor(robot, truth.truth)[0])
    return FrozenDrive(
        position=grid,
        A=np.array([one.A for one in sampled]),
        B=np.array([one.B[:, 0] for one in sampled]) / factor,
        C=np.array([one.C[: len(outputs)] for one in sampled]),
        sampling_period_s=sampling_period_s,
    )


def run_drive(drive: FrozenDrive, torque: FloatArray, position: FloatArray) -> FloatArray:
    """Runs a drive from rest, its matrices interpolated between the two nearest points of the grid.

    Recorded torque [N m] and where it is within the grid [rad, or m] are (n_sample,).

    Returns:
        Angles and positions (n_sample, n_out), from where they were at first.
    """
    place = np.clip((position - drive.position[0]) / (drive.position[1] - drive.position[0]), 0, _POINTS - 1)
    below = np.minimum(place.astype(int), _POINTS - 2)
    state = np.zeros(drive.A.shape[-1])
    outputs = np.empty((len(torque), drive.C.shape[1]))
    along = zip(below.tolist(), (place - below).tolist(), torque.tolist(), strict=True)
    for sample, (row, share, pushed) in enumerate(along):
        A, B, C = (one[row] + share * (one[row + 1] - one[row]) for one in (drive.A, drive.B, drive.C))
        outputs[sample] = C @ state
        state = A @ state + pushed * B
    return outputs


def drive_amplitudes(drive: FrozenDrive, torque: FloatArray, position: FloatArray, lines: IntArray) -> ComplexArray:
    """Runs a drive along measured torques and positions.

    What drives it off, as friction that is none of it, is differenced away: two differences of the outputs are
    stationary, and are undone at the DFT lines (n_freq,) of one period, above zero. Recorded torques [N m] and
    positions [rad, or m] are those of successive periods of the steady state (n_period, n_sample).

    Returns:
        Amplitudes of the outputs (n_period, n_freq, n_out), DFT sums over the number of samples.
    """
    n_period, n_sample = torque.shape
    outputs = run_drive(drive, led_in(torque[..., None])[:, 0], led_in(position[..., None])[:, 0])
    twice = np.diff(outputs, n=2, axis=0)[LEAD * n_sample - 2 :].reshape(n_period, n_sample, -1)
    back = 1 - np.exp(-2j * np.pi * lines / n_sample)
    return np.asarray(line_amplitudes(twice, lines) / back[:, None] ** 2)


LEAD = 2  # Periods in which transients pass before the first one that counts


@dataclass(frozen=True)
class ErrorParts:
    """Amplitudes of a model's error at the lines of successive periods."""

    total: FloatArray  # (n_freq, n_out) root mean square over the periods
    systematic: FloatArray  # (n_freq, n_out) of the mean over the periods: what repeats
    stochastic: FloatArray  # (n_freq, n_out) root mean square over the periods of what is left

    @property
    def over_stochastic(self) -> FloatArray:
        """Deviation of the error over that of its stochastic part (n_out,).

        Of P periods and an error that is all noise this is `sqrt(P / (P - 1))`.

        Source:
            Turk et al. (2018), sec. III-C3.
        """
        return np.asarray(deviation(self.total) / deviation(self.stochastic))


def split_errors(error: ComplexArray) -> ErrorParts:
    """Splits errors (n_period, n_freq, n_out) into what repeats and the rest.

    Source:
        Turk et al. (2018), sec. III-C3.
    """
    mean = error.mean(axis=0)
    return ErrorParts(_over_periods(error), np.abs(mean), _over_periods(error - mean))


def error_excess(parts: ErrorParts, reference: ErrorParts) -> FloatArray:
    """Returns by how much errors exceed those of a reference model (n_out,), as a share of these."""
    return np.asarray(deviation(parts.total) / deviation(reference.total) - 1)


def measured_amplitudes(samples: FloatArray, lines: IntArray) -> ComplexArray:
    """Returns amplitudes at DFT lines (n_freq,) of successive periods (n_period, n_sample, n_channel) without drift.

    Returns:
        DFT sums over the number of samples (n_period, n_freq, n_channel).
    """
    n_period, n_sample = samples.shape[:2]
    if n_period > 1:
        rise = np.gradient(samples.mean(axis=1), axis=0)
        samples = samples - rise[:, None] * ((np.arange(n_sample) + 0.5) / n_sample - 0.5)[:, None]
    return line_amplitudes(samples, lines)


def simulated_amplitudes(
    model: LpvModel, integrators: tuple[int, ...], inputs: FloatArray, scheduling: FloatArray, lines: IntArray
) -> ComplexArray:
    """Runs a model along measured inputs and scheduling parameters.

    Its transient passes in `LEAD` periods before the others, the same as the first of them. Integrators, so many of
    each output, behind which any offset of the inputs drifts away, are none of the stable model; they are put back at
    the DFT lines (n_freq,) of one period, above zero. Inputs (n_period, n_sample, n_in) and scheduling parameters
    (n_period, n_sample, n_scheduling) are those of successive periods of the steady state.

    Returns:
        Amplitudes of the outputs, as of `measured_amplitudes` (n_period, n_freq, n_out).

    Raises:
        DataError: If the parameters leave the model's range.
        ValueError: If the shapes do not agree.
    """
    n_period, n_sample = inputs.shape[:2]
    check_shape("scheduling", scheduling, "n_period n_sample n_scheduling", n_period=n_period, n_sample=n_sample)
    outputs, _ = simulate_lpv(model, led_in(inputs), led_in(scheduling))
    own = line_amplitudes(outputs[LEAD * n_sample :].reshape(n_period, n_sample, -1), lines)
    z = unit_circle(lines / (n_sample * model.sampling_period_s), model.sampling_period_s)
    return np.asarray(own / ((z[:, None] - 1) / model.sampling_period_s) ** np.array(integrators))


def deviation(amplitudes: FloatArray) -> FloatArray:
    """Returns the root mean square (n_out,) over the lines of amplitudes (n_freq, n_out)."""
    return np.asarray(np.sqrt(np.mean(amplitudes**2, axis=0)))


def led_in(samples: FloatArray) -> FloatArray:
    """Returns periods (n_period, n_sample, n_channel) in a row, the first of them `LEAD` times more."""
    return np.concatenate([*[samples[0]] * LEAD, samples.reshape(-1, samples.shape[-1])])


def _over_periods(values: ComplexArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(np.abs(values) ** 2, axis=0)))


_MOST_PERCENT = 15.0
_DIGITS = 3
_POOLED = 8
_ROWS = {  # the paper's key where it prints the figure
    "error_over_stochastic": ("Error of the fitted model over its stochastic part", "error_over_stochastic"),
    "true_error_over_stochastic": ("The same of the true drive, linearised wherever it is", ""),
    "total_over_noise": ("At one position: total deviation over that of the noise (eq. 20)", "total_over_noise"),
    "error_percent": ("Error of the fitted model over the output [%]", ""),
    "true_error_percent": ("The same of the true drive [%]", ""),
    "ratio_mismatch_percent": ("Excess of the fitted model's error over the true drive's [%]", ""),
    "acceleration_mismatch_percent": ("The same of accelerations [%]", ""),
    "uncompensated_mismatch_percent": ("Excess of a model fitted to responses with friction in them [%]", ""),
    "unmoved_mismatch_percent": ("Excess where the model is given a slide that stands still [%]", ""),
}
_NOTES = (
    "The two ratios need not agree. At one position friction reverses all the time and differs from realization to"
    " realization; in a sweep it reverses with the sweep, and repeats. And they are counted differently: of P periods"
    " with noise alone, the error is sqrt(P / (P - 1)) of its stochastic part, 1.08 for seven, while eq. 20 gives"
    " 1 / sqrt(P), 0.38.",
    "Friction and cogging are none of either model, and the torque that they take is fed to both: their share of the"
    " error repeats from period to period. So the fitted model is judged by how much more it misses than the true"
    " drive does, linearised at every position and run along the same torque and positions.",
    "At rest a drive sticks and friction is a part of its responses, in a sweep it slides: so the model is fitted to"
    " responses with friction taken out. One that has it in, good as it is at rest, misses more.",
    "Errors of positions weigh low lines, those of accelerations the resonance.",
)


def _conclude_travel(run: Run, case: TravelCase, _results: Results) -> PartFound:
    path = run.path(f"{case.campaign}/record.h5")
    record = record_from_artifact(read_artifact(path, RECORD))
    frf = frf_from_artifact(read_artifact(run.path(f"{case.fixed}/frf.h5"), FRF))
    periods = run.loaded.experiment.campaigns[case.fixed].periods
    truth = read_truth(path.with_name("truth.json"), path)
    travelled = travel(_solution(run, case.fit), record, truth)
    figures = travel_figures(travelled, total_over_noise(frf, travelled.outputs, periods))
    if case.uncompensated is not None:
        other = travel(_solution(run, case.uncompensated), record, truth)
        figures |= _by_output("uncompensated_mismatch_percent", other, 100 * other.excess(other.fitted))
    paper = paper_figures(run.loaded).get("global", {})
    unstable = "The fitted model is unstable: its error while the slide moves is not a number."
    return PartFound(
        figures,
        {"global.ratio_mismatch_percent": Asked(upper=_MOST_PERCENT)},
        (travel_section(travelled, figures, paper),),
        () if np.isfinite(travelled.fitted).all() else (unstable,),
    )


def _solution(run: Run, fit: str) -> LpvSolution:
    return solution_from_artifact(read_artifact(run.path(f"fits/{fit}/model.h5"), MODEL))


def travel_section(travelled: Travelled, figures: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    """Shows the figures beside the paper's, and over which lines the errors lie."""
    outputs = travelled.outputs
    rows = []
    for key, (title, printed) in _ROWS.items():
        if f"global.{key}.{outputs[0]}" in figures:
            published = (f"{value:.2f}" for value in paper.get(printed, ()))
            ours = (significant(figures[f"global.{key}.{name}"], _DIGITS) for name in outputs)
            rows.append((title, *chain(*zip(chain(published, repeat(MISSING)), ours, strict=False))))
    heads = [head for name in outputs for head in (f"{name}, paper", "Ours")]
    lead = (
        f"{len(travelled.measured)} periods of a slide that travels while it is excited, compared at the excited lines"
        " once drift is removed. What repeats of an error is its systematic part, the rest its stochastic one."
    )
    shown = Beside(tuple(_spectrum(travelled, column) for column in range(len(outputs))), columns=2)
    return Section("While the slide travels", lead, (Table(("Figure", *heads), tuple(rows)), Notes(_NOTES), shown))


def _spectrum(travelled: Travelled, column: int) -> Figure:
    fitted, true = travelled.error(travelled.fitted), travelled.error(travelled.true)
    amplitudes = {
        "measured": split_errors(travelled.measured).total,
        "error of the fitted model": fitted.total,
        "error of the true drive": true.total,
        "stochastic part": fitted.stochastic,
    }
    series = {name: 2 * _pooled(values[:, column]) for name, values in amplitudes.items()}
    name, unit = travelled.outputs[column], travelled.units[column]
    axes, caption = ("Frequency [Hz]", f"Amplitude [{unit}]"), f"Root mean square of {_POOLED} neighbouring lines."
    return figure(f"Output {name}", axes, _pooled(travelled.frequency_hz), series, caption=caption)


def _pooled(values: FloatArray) -> FloatArray:
    """Root mean squares of neighbouring lines, which calms what alternates from line to line."""
    groups = np.array_split(values, max(1, len(values) // _POOLED))
    return np.array([np.sqrt(np.mean(group**2)) for group in groups])


@dataclass(frozen=True)
class Travelled:
    """Amplitudes at the excited lines of a travelling slide."""

    frequency_hz: FloatArray  # (n_freq,) excited lines
    outputs: tuple[str, ...]
    units: tuple[str, ...]  # Their units, as they were measured
    measured: ComplexArray  # (n_period, n_freq, n_out) of each period
    fitted: ComplexArray  # (n_period, n_freq, n_out) of the fitted model, along the measured torque and position
    unmoved: ComplexArray  # (n_period, n_freq, n_out) the same, told that the slide stands where it is on average
    true: ComplexArray  # (n_period, n_freq, n_out) of the true drive, linearised wherever it is

    def error(self, modelled: ComplexArray, *, accelerations: bool = False) -> ErrorParts:
        """Returns the error of a model's amplitudes (n_period, n_freq, n_out)."""
        # Amplitudes become those of accelerations, but for the sign.
        squared = (2 * np.pi * self.frequency_hz[:, None]) ** 2
        return split_errors((self.measured - modelled) * (squared if accelerations else 1.0))

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
        message = f"D221 the record of the travelling slide lacks the output `{missing[0]}`"
        raise DataError(message, remedy="add it to the campaign's `outputs`")
    chosen, lines = [names.index(name) for name in ports.outputs], record.excited_lines
    torque, motion = record.inputs[0, 0, 0], record.outputs[0, 0, 0]
    position = motion[..., names.index(place)] + record.output_offset[0, names.index(place)]
    moved, stood = position[..., None], np.full_like(position[..., None], position.mean())
    fitted, unmoved = (_modelled(solution, record, each) for each in (moved, stood))
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
    """Returns what the study says of the travelling slide, and (n_out,) of the one at one position."""
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
    figures = {"global.ratio_mismatch_percent": 100 * float(excess.max())}
    for key, values in columns.items():
        figures |= _by_output(key, travelled, values)
    return figures


def _by_output(key: str, travelled: Travelled, values: FloatArray) -> dict[str, float]:
    named = zip(travelled.outputs, values.tolist(), strict=True)
    return {f"global.{key}.{name}": value for name, value in named}


def total_over_noise(frf: Frf, outputs: tuple[str, ...], periods: int) -> FloatArray:
    """Root of the mean over the lines of a response's total variance over that of one period's noise (n_out,).

    Without distortion it is `1 / sqrt(periods)`.

    Raises:
        DataError: If the response lacks an output, or a variance is unknown.

    Source:
        Turk et al. (2018), eq. 20.
    """
    names = [channel.name for channel in frf.output_channels]
    if frf.total_covariance is None or frf.noise_covariance is None or not set(outputs) <= set(names):
        message = "D222 the response at one position lacks an output of the model, or a variance"
        raise DataError(message, remedy="ask for the model's outputs, several realizations and several periods")
    total, noise = (frf.element_variance(noise_only=only)[0, :, :, 0] for only in (False, True))
    return np.asarray(np.sqrt(np.mean(total / (periods * noise), axis=0))[[names.index(name) for name in outputs]])


def _modelled(solution: LpvSolution, record: Record, scheduling: FloatArray) -> ComplexArray:
    names, ports = record.output_names, solution.ports
    lines, chosen = record.excited_lines, [names.index(name) for name in ports.outputs]
    if not solution.largest_pole < 1:
        return np.full((len(scheduling), len(lines), len(chosen)), np.nan, complex)
    core, integrators, inputs = solution.core_model, solution.core.integrators, record.inputs[0, 0, 0]
    own = simulated_amplitudes(core, integrators, inputs, scheduling, lines)
    units = [record.output_channels[index].unit for index in chosen]
    as_measured = [unit == modelled for unit, modelled in zip(units, ports.output_units, strict=True)]
    return np.asarray(own / np.where(as_measured, 1.0, output_factor(record, lines)[:, chosen]))


def _further_travel(run: Run, case: TravelCase) -> Further:
    models = tuple(fit_outputs(name)[0] for name in dict.fromkeys((case.fit, case.uncompensated)) if name)
    return ((run, (*models, f"{case.campaign}/record.h5", f"{case.fixed}/frf.h5")),)


TRAVEL = Part("global", _conclude_travel, further=_further_travel, field="travel")

"""Machines of known parameters over many seeds at once: recorded, identified with either of two filters, and judged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.models.rigid.fit import regression
from robid.models.rigid.fit.conclusion import Conclusion, conclude, solve_instruments
from robid.models.rigid.fit.options import ConclusionOptions, HuberOptions, PreprocessingOptions
from robid.models.rigid.fit.residuals import Influence
from robid.models.rigid.fit.rows import Reading, Regressor, Remembered, prepare
from robid.models.rigid.fit.solution import RowResiduals
from robid.models.rigid.page.residuals import course, histogram, weights
from robid.report.numbers import percent, significant
from robid.report.section import Figure, Notes, Table
from robid.settings.robot_parts import plain_settings
from robid.studies.page import Asked
from robid.studies.settings.parts import SeededCase
from robid.studies.study import Content, Task, in_chunks

FILTERS = ("good", "bad")  # Filters that suit, and filters that do not
BENDS = (HuberOptions.bend, 0.2, 0.01, 1e3)
"""Bends `H` that are shown: the usual one, the paper's 0.2, towards 0 and towards infinity."""
TESTS = ("Huber", "instruments", "normality", "whiteness")
_ITERATIONS = 1000  # towards H = 0 the weights settle slowly
_SIZE = "What errors are relative to: the truth, of a vector its norm"
_VALUE = "First seed: least squares, then Huber at `BENDS`"


@dataclass(frozen=True)
class Judged:
    """What seeds gave, and the first of them in detail."""

    names: Annotated[tuple[str, ...], Quantity("1", "parameter", "Names of the parameters")]
    units: Annotated[tuple[str, ...], Quantity("1", "parameter", "Their units")]
    truth: Annotated[FloatArray, Quantity("as in units", "parameter", "Their true values")]
    size: Annotated[FloatArray, Quantity("as in units", "parameter", _SIZE)]
    trust: Annotated[IntArray, Quantity("1", "seed", "1 where least squares was trusted")]
    alarms: Annotated[IntArray, Quantity("1", "seed test", "Which of `TESTS` spoke against it")]
    plain: Annotated[FloatArray, Quantity("as in units", "seed parameter", "Least squares as the paper has it")]
    instrumental: Annotated[FloatArray, Quantity("as in units", "seed parameter", "Instrumental variables")]
    deviation: Annotated[FloatArray, Quantity("N m", "seed joint", "Deviations of the residuals of `plain`")]
    value: Annotated[FloatArray, Quantity("as in units", "estimate parameter", _VALUE)]
    std: Annotated[FloatArray, Quantity("as in units", "estimate parameter", "Their deviations by eq. 8 and 19")]
    sigma: Annotated[FloatArray, Quantity("N m", "estimate joint", "Deviations of residuals, weighted by eq. 19")]
    iterations: Annotated[IntArray, Quantity("1", "estimate", "Passes that they took")]
    time_s: Annotated[FloatArray, Quantity("s", "row", "Time of the first seed's rows")]
    residual: Annotated[FloatArray, Quantity("N m", "row joint", "Of least squares, NaN where unused", compact=True)]
    weight: Annotated[FloatArray, Quantity("1", "row joint", "Huber's at the usual bend", compact=True)]
    sentence: str  # The verdict on it


def chunk_tasks(case: SeededCase, name: str, decides: dict[str, Any], *given: object) -> list[Task]:
    """Returns the tasks of a case: its seeds in chunks, with either of the filters."""
    own = plain_settings(case)
    settings = {key: own[key] for key in own if key not in ("seeds", "seeds_per_task", "first_seed")}
    found = []
    for seeds in in_chunks(case.first_seed, case.seeds, case.seeds_per_task):
        place = {"seeds": [seeds.start, seeds.stop], "bends": BENDS}
        found.append(Task(f"{name}_{seeds.start}", {**decides, **settings, **place}, (*given, case, seeds)))
    return found


def judge_chunk(machine: Machine, recording: Recording, case: SeededCase) -> Content:
    """Identifies every seed of a recording with either of the filters, the first seed in detail."""
    datasets, attributes = dict[str, Dataset](), dict[str, Attribute]()
    for name, cut in zip(FILTERS, cuts(case), strict=True):
        judged = _judged(machine, recording, PreprocessingOptions(cut, drop_deviations=case.drop_deviations))
        arrays, scalars = to_datasets(judged, f"{name}/")
        datasets, attributes = datasets | arrays, attributes | scalars
    return Content(datasets, attributes)


def gather(results: Iterable[Artifact], filters: str) -> Judged:
    """Joins the seeds of several tasks with one of the filters; the details are those of the first."""
    parts = [from_datasets(Judged, held, f"{filters}/") for held in results]
    joined = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in ("trust", "alarms", "plain", "instrumental", "deviation")
    }
    return Judged(**{**vars(parts[0]), **joined})


def _judged(machine: Machine, recording: Recording, options: PreprocessingOptions) -> Judged:
    found, size = identify(machine, recording, options), np.abs(machine.truth)
    for vector in machine.vectors:
        size[list(vector)] = np.linalg.norm(machine.truth[list(vector)])
    verdicts = [one.verdict for one in found.conclusions]
    instrumental = [one.instruments.parameters for one in found.conclusions if one.instruments is not None]
    # The paper's tables of the first seed: rows chosen by the measured speed, equal weights.
    rows = read(machine, recording, 0, options)
    reduction = regression.reduce_rows(rows)
    plain = regression.ordinary_least_squares(reduction)
    swept = regression.sweep_bend(
        rows, reduction, BENDS, HuberOptions(covariance="weighted", iteration_limit=_ITERATIONS)
    )
    residual, estimates = regression.residuals(rows, plain.parameters), (plain, *swept)
    period = recording.sampling_period_s * options.decimator(recording.sampling_period_s).factor
    kept = {"value": "parameters", "std": "standard_deviation", "sigma": "deviation", "iterations": "iterations"}
    alarms = [
        (one.huber.alarm, bool(one.instruments and one.instruments.alarm), one.normality_alarm, one.whiteness_alarm)
        for one in verdicts
    ]
    return Judged(
        names=tuple(machine.regressor.names),
        units=tuple(machine.regressor.units),
        truth=machine.truth,
        size=size,
        trust=np.array([verdict.trust for verdict in verdicts], int),
        alarms=np.array(alarms, int),
        plain=np.array([one.parameters for one in found.plain]),
        instrumental=np.array(instrumental),
        deviation=np.array([one.deviation for one in found.plain]),
        **{key: np.array([getattr(one, name) for one in estimates]) for key, name in kept.items()},
        time_s=np.arange(len(residual)) * period,
        residual=residual,
        weight=regression.huber_weights(regression.residuals(rows, swept[0].parameters) / swept[0].scale, BENDS[0]),
        sentence=verdicts[0].sentence,
    )


_SIMULATIONS = 5
_SETTLED = 1.0  # standard deviations; a further simulation moves the parameters by a hundredth of the step before


@dataclass(frozen=True)
class Machine:
    """A machine whose parameters are known."""

    regressor: Regressor  # Its inverse dynamics
    truth: FloatArray  # (n_param,) its parameters
    vectors: Sequence[Sequence[int]]  # Indices of the parameters that are one vector, such as a body's first moments
    # Simulates its loop without noise: positions (n_run, n_sample, n_joint) [rad] of parameters (n_run, n_param)
    simulate: Callable[[FloatArray], FloatArray]
    weighted: bool  # Whether least squares weighs its joints by their residuals
    # (n_param,) what the first instrument is simulated with; what least squares finds where there is none
    guess: FloatArray | None = None


@dataclass(frozen=True)
class Recording:
    """One machine recorded in closed loop, once a seed."""

    sampling_period_s: float  # Period of the samples [s]
    position: FloatArray  # (n_seed, n_sample, n_joint) encoder positions [rad]
    torque: FloatArray  # (n_seed, n_sample, n_joint) measured torques, each held until the next sample [N m]

    def __len__(self) -> int:
        return len(self.position)


@dataclass(frozen=True)
class Identified:
    """What the seeds of a recording gave."""

    plain: list[regression.Regression]  # Least squares as the paper has it, without instruments, of each seed
    conclusions: list[Conclusion]  # What the rows that are chosen by the instrument say, of each seed


def read(
    machine: Machine,
    recording: Recording,
    seed: int,
    options: PreprocessingOptions,
    instrument: FloatArray | None = None,
) -> Remembered:
    """Returns the rows of one seed, chosen by the instrument's speed (n_sample, n_joint) where there is one."""
    period, signals = recording.sampling_period_s, (recording.position[seed], recording.torque[seed])
    motion = prepare(*signals, period, options, instrument=instrument, held=True)
    return Remembered(Reading([motion], machine.regressor, options.decimator(period)))


def identify(machine: Machine, recording: Recording, options: PreprocessingOptions) -> Identified:
    """Identifies every seed of a recording."""
    fit = regression.weighted_least_squares if machine.weighted else regression.ordinary_least_squares
    plain = [fit(regression.reduce_rows(read(machine, recording, seed, options))) for seed in range(len(recording))]
    rows, found = _instruments(machine, recording, options, plain)
    decimator = options.decimator(recording.sampling_period_s)
    chosen = replace(ConclusionOptions(), weighted=machine.weighted)
    conclusions = [
        conclude(own, decimator, machine.regressor.names, one, vectors=machine.vectors, options=chosen)
        for own, one in zip(rows, found, strict=True)
    ]
    return Identified(plain, conclusions)


def _instruments(
    machine: Machine, recording: Recording, options: PreprocessingOptions, start: list[regression.Regression]
) -> tuple[list[Remembered], list[tuple[regression.Regression, Influence]]]:
    """Simulates all seeds at once, again and again, as `instrumental_variables` does for one."""
    guess = machine.guess
    parameters = np.array([estimate.parameters if guess is None else guess for estimate in start])
    for _ in range(_SIMULATIONS):
        instrument = machine.simulate(parameters)
        rows = [read(machine, recording, seed, options, own) for seed, own in enumerate(instrument)]
        found = [solve_instruments(own, estimate.weights) for own, estimate in zip(rows, start, strict=True)]
        before, parameters = parameters, np.array([one.parameters for one, _ in found])
        if np.max(np.abs(parameters - before) / [one.standard_deviation for one, _ in found]) <= _SETTLED:
            break
    return rows, found


VERDICTS = {"good": Asked(lower=0.95), "bad": Asked(lower=0.95)}
_BIAS_ALLOWED = 2.0  # per cent
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Errors:
    """Errors of the means over the seeds, in per cent of the truth, of a vector's parts of its norm."""

    least_squares: FloatArray  # (n_param,) of least squares
    instruments: FloatArray  # (n_param,) of the instrumental variables
    standard: FloatArray  # (n_param,) standard errors of these

    @property
    def excess(self) -> float:
        """Largest error of the instrumental variables over what is allowed: 3 standard errors, or 2 %."""
        allowed = np.maximum(_DEVIATIONS * self.standard, _BIAS_ALLOWED)
        return float(np.max(self.instruments / allowed))


def errors_of(judged: Judged) -> Errors:
    """Compares the means over the seeds with the truth."""
    relative, means = 100 / judged.size, (each.mean(axis=0) for each in (judged.plain, judged.instrumental))
    scatter = judged.instrumental.std(axis=0, ddof=1) / np.sqrt(len(judged.instrumental))
    plain, instruments = (np.abs(mean - judged.truth) * relative for mean in means)
    return Errors(plain, instruments, scatter * relative)


def verdict_figures(name: str, found: Mapping[str, Judged]) -> dict[str, float]:
    """Returns shares of right verdicts and of alarms, and the residuals' mean deviation, by filter."""
    figures: dict[str, float] = {f"{name}.seeds": len(found["good"].trust)}
    for filters, judged in found.items():
        trusted = float(judged.trust.mean())
        figures[f"{name}.{filters}.verdict_share"] = trusted if filters == "good" else 1 - trusted
        figures[f"{name}.{filters}.sigma"] = float(np.sqrt((judged.deviation**2).mean(axis=1)).mean())
        for test, share in zip(TESTS, judged.alarms.mean(axis=0).tolist(), strict=True):
            figures[f"{name}.{filters}.alarms.{test.lower()}"] = share
    return figures


def verdict_parts(found: Mapping[str, Judged], case: SeededCase) -> tuple[Table, Notes]:
    """Shares of the seeds that were trusted, and of those that each test spoke against; the words on the first seed."""
    judged = [found[filters] for filters in FILTERS]
    shares = {"Trusted": [one.trust for one in judged]}
    shares |= {f"Alarm: {test}": [one.alarms[:, at] for one in judged] for at, test in enumerate(TESTS)}
    rows = tuple((name, *(percent(float(values.mean())) for values in pair)) for name, pair in shares.items())
    heads = (f"{case.seeds} seeds", *(f"{cut:g} Hz" for cut in cuts(case)))
    said = (f"Seed {case.first_seed}, {cut:g} Hz: {one.sentence}" for one, cut in zip(judged, cuts(case), strict=True))
    return Table(heads, rows, title="Verdict on least squares", fit="compact"), Notes(tuple(said))


def cuts(case: SeededCase) -> tuple[float, float]:
    """Returns the cut-offs in the order of `FILTERS` [Hz]."""
    return case.good_cut_hz, case.bad_cut_hz


def error_table(judged: Judged, cut_hz: float) -> Table:
    """Errors of the means over the seeds."""
    errors = errors_of(judged)
    values = np.stack([errors.least_squares, errors.instruments, errors.standard], axis=1) / 100
    own = zip(judged.names, judged.units, judged.truth.tolist(), values.tolist(), strict=True)
    rows = tuple((name, unit, significant(truth), *map(percent, row)) for name, unit, truth, row in own)
    heads = ("Parameter", "Unit", "Truth", "Least squares", "Instruments", "Standard error")
    caption = (
        "Distance of the mean over the seeds from the truth, of first moments over their norm; the standard error is"
        " that of the instruments' mean."
    )
    return Table(heads, rows, title=f"Errors at {cut_hz:g} Hz", caption=caption)


def estimate_tables(found: Mapping[str, Judged], case: SeededCase) -> tuple[Table, ...]:
    """The first seed's estimates with either filter against the truth."""
    tables = []
    for filters, cut in zip(FILTERS, cuts(case), strict=True):
        judged = found[filters]
        values = np.stack([judged.truth, judged.plain[0], judged.value[1], judged.instrumental[0]], axis=1)
        own = zip(judged.names, judged.units, values.tolist(), strict=True)
        rows = tuple((f"{name} [{unit}]", *map(significant, row)) for name, unit, row in own)
        heads = ("Base parameter", "Truth", "Least squares", "Huber", "Instruments")
        tables.append(Table(heads, rows, title=f"Estimates of seed {case.first_seed} at {cut:g} Hz", fit="compact"))
    return tuple(tables)


def residual_figures(judged: Judged, joint: int, names: tuple[str, str, str]) -> tuple[Figure, ...]:
    """Histogram, weights and course of one joint's residuals of the first seed."""
    rows = RowResiduals(judged.time_s, judged.residual, judged.residual, judged.weight)
    shown = zip((histogram, weights, course), names, strict=True)
    return tuple(draw(rows, joint, name, "N m") for draw, name in shown)


def outlier_share(judged: Judged) -> float:
    """Returns the share of the first seed's residuals beyond three deviations."""
    residual = judged.residual[np.isfinite(judged.residual)]
    return float(np.mean(np.abs(residual) > _DEVIATIONS * residual.std()))

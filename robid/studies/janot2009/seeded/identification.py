"""Machines of known parameters, recorded and identified over many seeds at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.conclusion import Conclusion, conclude, solve_instruments
from robid.models.rigid.fit.options import ConclusionOptions, PreprocessingOptions
from robid.models.rigid.fit.regression import Regression, ordinary_least_squares, reduce_rows, weighted_least_squares
from robid.models.rigid.fit.residuals import Influence
from robid.models.rigid.fit.rows import Reading, Regressor, Remembered, prepare

_SIMULATIONS = 5
_SETTLED = 1.0  # standard deviations; a further simulation moves the parameters by a hundredth of the step before


@dataclass(frozen=True)
class Machine:
    """A machine whose parameters are known.

    Attributes:
        regressor: Its inverse dynamics.
        truth (n_param,): Its parameters.
        vectors: Indices of the parameters that are one vector, such as a body's first moments.
        simulate: Simulates its loop without noise: positions (n_run, n_sample, n_joint) [rad] of parameters
            (n_run, n_param).
        weighted: Whether least squares weighs its joints by their residuals.
        guess (n_param,): What the first instrument is simulated with; what least squares finds where there is none.
    """

    regressor: Regressor
    truth: FloatArray
    vectors: Sequence[Sequence[int]]
    simulate: Callable[[FloatArray], FloatArray]
    weighted: bool
    guess: FloatArray | None = None


@dataclass(frozen=True)
class Recording:
    """One machine recorded in closed loop, once a seed.

    Attributes:
        sampling_period_s: Period of the samples [s].
        position (n_seed, n_sample, n_joint): Encoder positions [rad].
        torque (n_seed, n_sample, n_joint): Measured torques, each held until the next sample [N m].
    """

    sampling_period_s: float
    position: FloatArray
    torque: FloatArray

    def __len__(self) -> int:
        return len(self.position)


@dataclass(frozen=True)
class Identified:
    """What the seeds of a recording gave.

    Attributes:
        plain: Least squares as the paper has it, without instruments, of each seed.
        conclusions: What the rows that are chosen by the instrument say, of each seed.
    """

    plain: list[Regression]
    conclusions: list[Conclusion]


def read(
    machine: Machine,
    recording: Recording,
    seed: int,
    options: PreprocessingOptions,
    instrument: FloatArray | None = None,
) -> Remembered:
    """Returns the rows of one seed, chosen by the instrument's speed (n_sample, n_joint) where there is one."""
    period = recording.sampling_period_s
    motion = prepare(
        recording.position[seed], recording.torque[seed], period, options, instrument=instrument, held=True
    )
    return Remembered(Reading([motion], machine.regressor, options.decimator(period)))


def identify(machine: Machine, recording: Recording, options: PreprocessingOptions) -> Identified:
    """Identifies every seed of a recording.

    Args:
        machine: What was recorded.
        recording: Its records.
        options: The filters.
    """
    fit = weighted_least_squares if machine.weighted else ordinary_least_squares
    plain = [fit(reduce_rows(read(machine, recording, seed, options))) for seed in range(len(recording))]
    rows, found = _instruments(machine, recording, options, plain)
    decimator = options.decimator(recording.sampling_period_s)
    chosen = replace(ConclusionOptions(), weighted=machine.weighted)
    conclusions = [
        conclude(own, decimator, machine.regressor.names, one, vectors=machine.vectors, options=chosen)
        for own, one in zip(rows, found, strict=True)
    ]
    return Identified(plain, conclusions)


def _instruments(
    machine: Machine, recording: Recording, options: PreprocessingOptions, start: list[Regression]
) -> tuple[list[Remembered], list[tuple[Regression, Influence]]]:
    """Simulates all seeds at once, again and again, as `instrumental_variables` does for one."""
    known = None if machine.guess is None else np.tile(machine.guess, (len(start), 1))
    parameters = np.array([estimate.parameters for estimate in start]) if known is None else known
    for _ in range(_SIMULATIONS):
        instrument = machine.simulate(parameters)
        rows = [read(machine, recording, seed, options, own) for seed, own in enumerate(instrument)]
        found = [solve_instruments(own, estimate.weights) for own, estimate in zip(rows, start, strict=True)]
        step = [
            np.abs(one.parameters - before) / one.standard_deviation
            for (one, _), before in zip(found, parameters, strict=True)
        ]
        parameters = np.array([one.parameters for one, _ in found])
        if np.max(step) <= _SETTLED:
            break
    return rows, found

"""The haptic device identified over many seeds, with filters that suit and filters that do not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.fit.rigid.conclusion import Conclusion, conclude
from robid.fit.rigid.instruments import solve_instruments
from robid.fit.rigid.least_squares import Regression, ordinary_least_squares
from robid.fit.rigid.options import ConclusionOptions, PreprocessingOptions
from robid.fit.rigid.preprocessing import prepare
from robid.fit.rigid.reading import Reading
from robid.fit.rigid.reduction import reduce_rows
from robid.fit.rigid.rows import Remembered
from robid.fit.rigid.uncertainty import Influence
from robid.studies.janot2009.haptic import NAMES, NOMINAL, Bench, Device, measured, simulate

FIRST_MOMENTS = ((1, 2),)
_DROP_DEVIATIONS = 15.0  # on seeds of their own: 6 to 12 leave the instruments' viscous friction off by 2 to 4 %
_SIMULATIONS = 5


@dataclass(frozen=True)
class Recording:
    """Devices recorded in closed loop.

    Attributes:
        bench: The loop.
        position (n_sample, n_seed): Encoder positions [rad].
        torque (n_sample, n_seed): Measured torques, each held until the next sample [N m].
    """

    bench: Bench
    position: FloatArray
    torque: FloatArray


def record(seeds: range, bench: Bench) -> Recording:
    """Simulates one device a seed: the zero of its encoder and its torque noise differ."""
    generators = [np.random.default_rng(seed) for seed in seeds]
    phase = np.array([generator.uniform(0, bench.quantum_rad) for generator in generators])
    position, torque = simulate(np.tile(NOMINAL, (len(seeds), 1)), bench, phase)
    noise = [generator.standard_normal(len(torque)) for generator in generators]
    return Recording(bench, measured(position, bench, phase), torque + bench.torque_noise_nm * np.stack(noise, axis=1))


def read(recording: Recording, seed: int, options: PreprocessingOptions, instrument: FloatArray | None) -> Remembered:
    """Returns the rows of one seed, chosen by the instrument's speed (n_sample,) where there is one."""
    period = recording.bench.sampling_period_s
    motion = prepare(
        recording.position[:, [seed]],
        recording.torque[:, [seed]],
        period,
        options,
        instrument=None if instrument is None else instrument[:, None],
        held=True,
    )
    return Remembered(Reading([motion], Device(), options.decimator(period)))


def identify(recording: Recording, cut_hz: float) -> tuple[list[Regression], list[Conclusion]]:
    """Identifies every seed.

    Args:
        recording: The devices.
        cut_hz: Cut-off of the positions and of the rows [Hz].

    Returns:
        Least squares as the paper has it, without instruments, of each seed; and what the rows that are chosen by the
        instrument say.
    """
    options = PreprocessingOptions(cut_hz, drop_deviations=_DROP_DEVIATIONS)
    seeds = range(recording.position.shape[1])
    plain = [ordinary_least_squares(reduce_rows(read(recording, seed, options, None))) for seed in seeds]
    instrument, found = _instruments(recording, options, plain)
    decimator = options.decimator(recording.bench.sampling_period_s)
    chosen = replace(ConclusionOptions(), weighted=False)
    conclusions = [
        conclude(
            read(recording, seed, options, instrument[:, seed]),
            decimator,
            NAMES,
            found[seed],
            vectors=FIRST_MOMENTS,
            options=chosen,
        )
        for seed in seeds
    ]
    return plain, conclusions


def _instruments(
    recording: Recording, options: PreprocessingOptions, start: list[Regression]
) -> tuple[FloatArray, list[tuple[Regression, Influence]]]:
    """Simulates all seeds at once, again and again, as `instrumental_variables` does for one."""
    parameters = np.array([estimate.parameters for estimate in start])
    for _ in range(_SIMULATIONS):
        instrument, _ = simulate(parameters, recording.bench)
        found = [
            solve_instruments(read(recording, seed, options, instrument[:, seed]), estimate.weights)
            for seed, estimate in enumerate(start)
        ]
        parameters = np.array([estimate.parameters for estimate, _ in found])
    return instrument, found


def summarise(plain: list[Regression], conclusions: list[Conclusion]) -> dict[str, float]:
    """Returns the study's figures of one cut-off: verdicts, residuals, and the errors of the means over the seeds."""
    truth = np.array(NOMINAL)
    size = truth.copy()
    for vector in FIRST_MOMENTS:
        size[list(vector)] = np.linalg.norm(truth[list(vector)])
    instrumental = np.array([one.instruments.parameters for one in conclusions if one.instruments is not None])
    standard_error = 100 * instrumental.std(axis=0, ddof=1) / np.sqrt(len(instrumental)) / size
    error = 100 * np.abs(instrumental.mean(axis=0) - truth) / size
    bias = 100 * np.abs(np.mean([one.parameters for one in plain], axis=0) - truth) / size
    return {
        "trust_share": float(np.mean([one.verdict.trust for one in conclusions])),
        "sigma": float(np.mean([one.deviation[0] for one in plain])),
        "iv.max_error_percent": float(error.max()),
        "iv.max_excess": float((error / np.maximum(3 * standard_error, 2.0)).max()),
        "ls.max_error_percent": float(bias.max()),
    }

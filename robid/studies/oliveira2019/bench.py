"""The paper's transfer functions as plants, excited and measured as its robot was; shares no code with any fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import StateSpace, cont2discrete, dlsim, tf2ss

from robid.arrays import ComplexArray, FloatArray
from robid.signals.waveforms import chirp
from robid.studies.settings.parts import PlantsCase

_MILLIMETRE, _DEGREE = 1e-3, float(np.pi / 180)
ROTATIONS = ("A", "B", "C")
PRINTED = {"m": _MILLIMETRE, "rad": _DEGREE}
"""Units that the paper prints, millimetres and degrees, in SI units."""


@dataclass(frozen=True)
class Plant:
    """One channel of the paper's robot."""

    name: str  # Name of the channel
    numerator: tuple[float, ...]  # (n_zero + 1,) of its transfer function, highest power first
    denominator: tuple[float, ...]  # (n_pole + 1,) as the numerator
    amplitude: Mapping[float, float]  # Largest command of a chirp [m or rad] by its highest frequency [Hz]
    resolution: float  # Quantum of the measured position [m or rad]

    @property
    def unit(self) -> str:
        """Unit of command and position."""
        return "rad" if self.name in ROTATIONS else "m"


@dataclass(frozen=True)
class Bench:
    """How the plants are excited and measured."""

    sampling_period_s: float  # Period of commands and measurements [s]
    duration_s: float  # Length of a chirp [s]
    low_hz: float  # Where a chirp begins [Hz]
    repeats: int  # How often each is played
    delay_samples: int  # Transport delay
    moving_average: int  # Samples of the commands that are averaged
    noise_resolutions: float  # Deviation of the noise before quantising, over the resolution

    @property
    def n_sample(self) -> int:
        """Samples of a record."""
        return int(self.duration_s / self.sampling_period_s)

    def command(self, plant: Plant, high_hz: float) -> FloatArray:
        """Returns the chirp (n_sample,) up to a frequency, its amplitude falling to zero [m or rad]."""
        period = self.sampling_period_s
        wave = chirp(self.low_hz * period, high_hz * period, self.n_sample, peak=0.0)
        return plant.amplitude[high_hz] * wave

    def answer(self, plant: Plant, command: FloatArray) -> FloatArray:
        """Returns the true position (n_sample,) of a plant at rest that is told a command [m or rad]."""
        before = self.moving_average - 1
        padded = np.concatenate([np.zeros(before), command])
        averaged = np.lib.stride_tricks.sliding_window_view(padded, self.moving_average).mean(axis=-1)
        late = np.concatenate([np.zeros(self.delay_samples), averaged])[: len(command)]
        system = StateSpace(*tf2ss(plant.numerator, plant.denominator))
        matrices = cont2discrete((system.A, system.B, system.C, system.D), self.sampling_period_s, method="zoh")
        return np.asarray(dlsim(matrices, late[:, None])[1][:, 0])

    def step(self, plant: Plant, n_sample: int) -> FloatArray:
        """Returns the true answer (n_sample,) to a unit step without the moving average, at the samples."""
        return replace(self, moving_average=1).answer(plant, np.ones(n_sample))

    def measure(self, plant: Plant, answer: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Returns what is measured of a position (n_repeat, n_sample): noisy, then quantised [m or rad]."""
        noise = generator.standard_normal((self.repeats, len(answer)))
        steps = answer / plant.resolution + self.noise_resolutions * noise
        return plant.resolution * np.round(steps)

    def response(self, plant: Plant, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the true response (n_freq,) from samples to samples: with hold, average and delay."""
        z = np.exp(2j * np.pi * frequency_hz * self.sampling_period_s)
        above, below, _ = cont2discrete((plant.numerator, plant.denominator), self.sampling_period_s, method="zoh")
        average = np.mean([z**-lag for lag in range(self.moving_average)], axis=0)
        held = np.polyval(np.ravel(above), z) / np.polyval(below, z)
        return np.asarray(held * average * z**-self.delay_samples)

    def continuous(self, plant: Plant, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the true response (n_freq,) of the transfer function, with the delay."""
        s = 2j * np.pi * frequency_hz
        late = np.exp(-s * self.delay_samples * self.sampling_period_s)
        return np.asarray(np.polyval(plant.numerator, s) / np.polyval(plant.denominator, s) * late)


def plants_of(paper: Mapping[str, Any]) -> tuple[Plant, ...]:
    """Returns the plants of the paper's Table 3, with the amplitudes of its Table 1."""
    found = []
    for name, function in paper["table_3"].items():
        kind, unit = ("rotation", _DEGREE) if name in ROTATIONS else ("translation", _MILLIMETRE)
        sizes = [unit * size for size in paper["amplitudes"][name]]
        found.append(
            Plant(
                name=name,
                numerator=tuple(map(float, function["numerator"])),
                denominator=tuple(map(float, function["denominator"])),
                amplitude=dict(zip(paper["high_hz"], sizes, strict=True)),
                resolution=unit * paper["resolution"][kind],
            )
        )
    return tuple(found)


def bench_of(paper: Mapping[str, Any], case: PlantsCase) -> Bench:
    """Returns the paper's experiment with what it leaves open."""
    return Bench(
        sampling_period_s=paper["sampling_period_s"],
        duration_s=paper["duration_s"],
        low_hz=paper["low_hz"],
        repeats=paper["repeats"],
        delay_samples=case.delay_samples,
        moving_average=case.moving_average,
        noise_resolutions=case.noise_resolutions,
    )

"""Random plants and their measured responses, for trials of fits to responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.denominator import denominator_of
from robid.models.external.response.descent import descend
from robid.models.external.response.lines import make_lines

KINDS = ("siso", "delay", "integrators", "mimo", "noncollocated")


@dataclass(frozen=True)
class Plant:
    """A true transfer matrix: state space with a delay."""

    A: FloatArray  # (n_pole, n_pole)
    B: FloatArray  # (n_pole, n_in)
    C: FloatArray  # (n_out, n_in, n_pole) Rows of each element
    D: FloatArray  # (n_out, n_in)
    poles: ComplexArray  # (n_pole,) [rad/s]
    integrators: int
    delay_s: float

    def response(self, frequency_hz: FloatArray) -> ComplexArray:
        """The response (n_freq, n_out, n_in)."""
        s = 2j * np.pi * np.asarray(frequency_hz)
        states = np.linalg.solve(s[:, None, None] * np.eye(len(self.A)) - self.A, self.B.astype(complex)[None])
        found = np.einsum("oip,fpi->foi", self.C, states) + self.D
        return np.asarray(found * np.exp(-s * self.delay_s)[:, None, None])


def _modal(
    rng: np.random.Generator,
    poles_real: Sequence[float],
    pairs: Sequence[tuple[float, float]],
    shape: tuple[int, int],
    integrators: int,
) -> tuple[FloatArray, FloatArray, FloatArray, ComplexArray]:
    """Partial fractions: each pole acts on every element with weights of its own."""
    blocks: list[FloatArray] = []
    rows: list[FloatArray] = []
    for w, zeta in pairs:
        # (a w^2 + b w s) / (s^2 + 2 zeta w s + w^2), scaled by the damping's root so that weak damping does not drown
        # the rest
        blocks.append(w * np.array([[0.0, 1.0], [-1.0, -2 * zeta]]))
        gain = rng.standard_normal(shape) * np.sqrt(zeta / 0.02) ** 0.5
        rows += [gain, 0.3 * rng.standard_normal(shape) * gain]
    for p in poles_real:
        blocks.append(np.array([[-p]]))
        rows.append(rng.standard_normal(shape))
    size = sum(len(block) for block in blocks) + integrators
    A, b = np.zeros((size, size)), np.zeros(size)
    place = 0
    for block in blocks:
        n = len(block)
        A[place : place + n, place : place + n] = block
        b[place + n - 1] = abs(block[-1, 0]) if n == 1 else block[0, 1]
        place += n
    if integrators:
        low = min([*(w for w, _ in pairs), *poles_real])
        b[place + integrators - 1] = low
        for k in range(integrators - 1):
            A[place + k, place + k + 1] = low
        rows += [rng.choice([-1.0, 1.0], shape) * np.exp(0.5 * rng.standard_normal(shape)) for _ in range(integrators)]
    poles = np.concatenate(
        [[-z * w + 1j * w * np.sqrt(1 - z * z), -z * w - 1j * w * np.sqrt(1 - z * z)] for w, z in pairs]
        + [[-p] for p in poles_real]
        + [np.zeros(integrators)]
    )
    return A, np.repeat(b[:, None], shape[1], axis=1), np.moveaxis(np.array(rows), 0, -1), poles.astype(complex)


def _chain(rng: np.random.Generator, f_low: float, f_high: float) -> Plant:
    """Two or three masses in a row: a force on the first, position or velocity of the last, free or on the ground."""
    n = int(rng.integers(2, 4))
    masses = np.exp(0.5 * rng.standard_normal(n))
    springs = np.exp(rng.standard_normal(n - 1))
    grounded = rng.random() < 0.5
    ground = np.exp(rng.standard_normal() - 1.0) if grounded else 0.0
    K = np.zeros((n, n))
    K[0, 0] += ground
    for k, spring in enumerate(springs):
        K[k : k + 2, k : k + 2] += spring * np.array([[1, -1], [-1, 1]])
    half = 1 / np.sqrt(masses)
    values, shapes = np.linalg.eigh(half[:, None] * K * half)
    w = np.sqrt(np.maximum(values, 0))
    if not grounded:
        w[0] = 0
    flexible = w[w > 0]
    middle = np.exp(rng.uniform(np.log(f_low * 3), np.log(f_high / 3))) * 2 * np.pi
    w = w * middle / np.exp(np.mean(np.log(flexible)))
    zeta = np.exp(rng.uniform(np.log(0.002), np.log(0.05), n))
    modal = half[:, None] * shapes
    velocity = rng.random() < 0.5
    blocks_A, b, c = _modal_system(w, zeta, modal, middle, speed=velocity)
    if velocity and not grounded:
        # The free body's position does not show in a velocity.
        kept = np.arange(2 * n) != 0
        blocks_A, b, c = blocks_A[np.ix_(kept, kept)], b[kept], c[kept]
    poles: list[complex] = []
    for k in range(n):
        if w[k] > 0:
            poles += [
                w[k] * complex(-zeta[k], np.sqrt(1 - zeta[k] ** 2)),
                w[k] * complex(-zeta[k], -np.sqrt(1 - zeta[k] ** 2)),
            ]
        else:
            poles += [0.0] * (1 if velocity else 2)
    integrators = 0 if grounded else 2 - velocity
    return Plant(blocks_A, b[:, None], c[None, None, :], np.zeros((1, 1)), np.array(poles, complex), integrators, 0.0)


def _modal_system(
    w: FloatArray, zeta: FloatArray, modal: FloatArray, scale: float, *, speed: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, B and C of modes with two states each, speeds in units of `scale`: first mass driven, last one seen."""
    n = len(w)
    A, b, c = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.zeros(2 * n)
    for k in range(n):
        A[2 * k, 2 * k + 1] = scale
        A[2 * k + 1, 2 * k : 2 * k + 2] = [-(w[k] ** 2) / scale, -2 * zeta[k] * w[k]]
        b[2 * k + 1] = modal[0, k] * scale
        c[2 * k + speed] = modal[-1, k]
    return A, b, c


def _draw(rng: np.random.Generator, kind: str, n_pole: int, f_low: float, f_high: float) -> Plant:
    if kind == "noncollocated":
        return _chain(rng, f_low, f_high)
    integrators = min(int(rng.integers(1, 3)), n_pole - 1) if kind == "integrators" else 0
    left = n_pole - integrators
    n_pair = int(rng.binomial(left // 2, 0.8))
    n_real = left - 2 * n_pair
    low, high = 2 * np.pi * f_low * 1.5, 2 * np.pi * f_high / 1.5
    frequencies = np.exp(rng.uniform(np.log(low), np.log(high), n_pair))
    dampings = np.where(
        rng.random(n_pair) < 0.7,
        np.exp(rng.uniform(np.log(0.002), np.log(0.05), n_pair)),
        np.exp(rng.uniform(np.log(0.05), np.log(0.7), n_pair)),
    )
    real = np.exp(rng.uniform(np.log(low), np.log(high), n_real))
    n_out, n_in = (2, 3) if kind == "mimo" else (1, 1)
    direct = (rng.random() < 0.2) * rng.standard_normal((n_out, n_in))
    delay = rng.uniform(0.1, 3.0) / f_high if kind == "delay" else 0.0
    pairs = list(zip(frequencies.tolist(), dampings.tolist(), strict=True))
    A, B, C, poles = _modal(rng, real.tolist(), pairs, (n_out, n_in), integrators)
    return Plant(A, B, C, direct, poles, integrators, delay)


def _variance(rng: np.random.Generator, response: ComplexArray) -> FloatArray:
    """A variance that depends on frequency: a share of the response that drifts over the lines, and a floor."""
    n_freq = len(response)
    phase = np.linspace(0, 2 * np.pi * rng.uniform(0.3, 1.5), n_freq) + rng.uniform(0, 2 * np.pi)
    share = np.exp(rng.uniform(np.log(0.003), np.log(0.05)) + 0.5 * np.sin(phase))
    floor = np.median(np.abs(response), axis=0) * np.exp(rng.uniform(np.log(1e-3), np.log(3e-2)))
    return np.asarray((share[:, None, None] * np.abs(response)) ** 2 + floor**2)


def cost_of_removal(plant: Plant, frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray) -> float:
    """By how much the best model of fewer poles, with a delay and as many zeros as poles, misses the exact response."""
    lines = make_lines(MeasuredResponse(frequency_hz, response, variance), "continuous")
    poles = plant.poles[np.abs(plant.poles) > 0] / lines.reference
    delay = plant.delay_s / lines.delay_unit_s
    least = np.inf
    for index, pole in enumerate(poles):
        if pole.imag < 0:
            continue
        gone = [index] if pole.imag == 0 else [index, int(np.argmin(np.abs(poles - pole.conj())))]
        rest = np.delete(poles, gone)
        for instead in [rest] if pole.imag == 0 else [rest, np.append(rest, -abs(pole))]:
            start = denominator_of(instead.astype(complex), plant.integrators)
            degrees = (start.n_pole,) * lines.n_element
            least = min(least, descend(lines, start, delay, degrees, longest=40.0, max_iterations=40).cost)
        if least < 1:
            break
    return least


def draw(kind: str, seed: int) -> tuple[Plant, MeasuredResponse]:
    """Draws a plant and its measured response; drawn again unless every pole's removal raises the cost enough.

    Raises:
        RuntimeError: If 2,000 draws give none.
    """
    rng = np.random.default_rng([KINDS.index(kind), seed])
    n_pole = int(rng.integers(2, 13))
    for _ in range(2000):
        n_freq = int(rng.integers(150, 301))
        f_low = 1.0
        f_high = 10 ** rng.uniform(1.5, 3.0)
        linear = rng.random() < 0.3
        frequency = np.linspace(f_high / n_freq, f_high, n_freq) if linear else np.geomspace(f_low, f_high, n_freq)
        plant = _draw(rng, kind, n_pole, frequency[0] * (5 if linear else 1), f_high)
        response = plant.response(frequency)
        variance = _variance(rng, response)
        if cost_of_removal(plant, frequency, response, variance) > 4 * np.log(response.size):
            noise = rng.standard_normal(response.shape) + 1j * rng.standard_normal(response.shape)
            return plant, MeasuredResponse(frequency, response + noise * np.sqrt(variance / 2), variance)
    message = f"no plant of {n_pole} poles"
    raise RuntimeError(message)

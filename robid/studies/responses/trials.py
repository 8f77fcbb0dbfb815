"""Trials of fits to responses: a random plant measured with noise, fitted, and compared with the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.result import RationalFit
from robid.studies.responses.plants import Plant, draw

N_FREQUENCY = 20


@dataclass(frozen=True)
class Outcome:
    """What one trial came to."""

    n_true: int
    n_found: int  # -1 where the fit failed
    integrators: tuple[int, int]  # true ones, found ones
    response: tuple[bool, ...] = ()  # whether each interval of a real part contains the truth
    poles: tuple[bool, ...] = ()  # the same of poles, where the order is right
    seconds: float = 0.0


def trial(kind: str, seed: int, options: ResponseFitOptions | None = None) -> Outcome:
    """Fits one random plant."""
    plant, data = draw(kind, seed)
    n_true = len(plant.poles)
    begin = time.perf_counter()
    try:
        fit = fit_response(data, options or ResponseFitOptions(max_poles=12))
    except (ArithmeticError, RuntimeError, ValueError):
        # A refusal is a miss.
        return Outcome(n_true, -1, (plant.integrators, -1))
    seconds = time.perf_counter() - begin
    rng = np.random.default_rng([7, seed])
    low, high = np.log(data.frequency_hz[[0, -1]]).tolist()
    places = np.exp(rng.uniform(low, high, N_FREQUENCY))
    found, true = fit.response_at(places), plant.response(places)
    half = fit.quantile
    inside = [
        np.abs((found.response - true).real) <= half * found.real_std,
        np.abs((found.response - true).imag) <= half * found.imaginary_std,
    ]
    poles = _poles_inside(fit, plant) if fit.n_pole == n_true else ()
    return Outcome(
        n_true, fit.n_pole, (plant.integrators, fit.integrators), tuple(np.ravel(inside).tolist()), poles, seconds
    )


def _poles_inside(fit: RationalFit, plant: Plant) -> tuple[bool, ...]:
    """Whether intervals of real and imaginary parts contain the poles; those kept at zero are no estimates."""
    true = plant.poles[np.argsort(np.abs(plant.poles))][fit.integrators :]
    places = np.array([root.place for root in fit.poles])
    distance = np.abs(places[:, None] - true) / (np.abs(places[:, None]) + np.abs(true) + 1e-300)
    inside: list[bool] = []
    for row, column in zip(*linear_sum_assignment(distance), strict=True):
        root, pole = fit.poles[row], true[column]
        if pole.imag < 0:
            continue
        low, high = fit.interval(root)
        inside.append(bool(low.real <= pole.real <= high.real))
        if pole.imag > 0:
            inside.append(bool(low.imag <= pole.imag <= high.imag))
    return tuple(inside)


def summary(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Shares of trials: right orders and integrators, and intervals that contain the truth; mean time [s]."""
    inside = [each for one in outcomes for each in one.response]
    poles = [each for one in outcomes for each in one.poles]
    return {
        "order": float(np.mean([one.n_found == one.n_true for one in outcomes])),
        "integrators": float(np.mean([one.integrators[0] == one.integrators[1] for one in outcomes])),
        "coverage": float(np.mean(inside)) if inside else 0.0,
        "pole_coverage": float(np.mean(poles)) if poles else 0.0,
        "seconds": float(np.mean([one.seconds for one in outcomes])),
    }

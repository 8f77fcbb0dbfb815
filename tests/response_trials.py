"""Trials of fits to responses: a random plant measured with noise, fitted, and compared with the truth."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from response_plants import KINDS, draw
from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions

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
    places = np.exp(rng.uniform(*np.log(data.frequency_hz[[0, -1]]), N_FREQUENCY))
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


def _poles_inside(fit, plant):
    """Whether intervals of real and imaginary parts contain the poles; those kept at zero are no estimates."""
    true = plant.poles[np.argsort(np.abs(plant.poles))][fit.integrators :]
    places = np.array([root.place for root in fit.poles])
    distance = np.abs(places[:, None] - true) / (np.abs(places[:, None]) + np.abs(true) + 1e-300)
    inside = []
    for row, column in zip(*linear_sum_assignment(distance), strict=True):
        root, pole = fit.poles[row], true[column]
        if pole.imag < 0:
            continue
        low, high = fit.interval(root)
        inside.append(bool(low.real <= pole.real <= high.real))
        if pole.imag > 0:
            inside.append(bool(low.imag <= pole.imag <= high.imag))
    return tuple(inside)


def summary(outcomes: list[Outcome]) -> dict[str, float]:
    """Shares of a kind's trials."""
    flat = lambda name: [each for one in outcomes for each in getattr(one, name)]  # noqa: E731
    return {
        "order": float(np.mean([one.n_found == one.n_true for one in outcomes])),
        "integrators": float(np.mean([one.integrators[0] == one.integrators[1] for one in outcomes])),
        "coverage": float(np.mean(flat("response"))),
        "pole_coverage": float(np.mean(flat("poles"))),
        "seconds": float(np.mean([one.seconds for one in outcomes])),
    }


def main() -> None:
    """Runs trials of kinds, separated by commas, on seeds FIRST:LAST, and writes one line a kind."""
    kinds = KINDS if sys.argv[1] == "all" else sys.argv[1].split(",")
    first, last = (int(each) for each in sys.argv[2].split(":"))
    for kind in kinds:
        outcomes = {seed: trial(kind, seed) for seed in range(first, last)}
        missed = [(seed, one.n_true, one.n_found) for seed, one in outcomes.items() if one.n_true != one.n_found]
        figures = {name: round(value, 4) for name, value in summary(list(outcomes.values())).items()}
        sys.stdout.write(f"{kind} {last - first} {figures} missed (seed, true, found): {missed}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()

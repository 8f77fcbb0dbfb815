"""Random candidates of designs, and what may be measured of them."""

import numpy as np

from robid.design.configurations.exchange import Exchange, Information
from robid.design.configurations.visits import make_visits


def random_parts(n_cand, n_row, n_param, seed, n_part=1):
    jacobian = np.random.default_rng(seed).normal(size=(1, n_cand, n_part, n_row, n_param))
    return jacobian.swapaxes(-1, -2) @ jacobian


def make_exchange(parts, experiments, between=0.0, **changes):
    n_cand = parts.shape[1]
    visits = make_visits(parts, np.full(parts.shape[-1], between**2))
    told = {"criterion": "d", "base": 1e-9 * parts.mean(axis=1), "wanted": None}
    told |= {name: changes.pop(name) for name in tuple(changes) if name in told}
    optional = {
        "distinct": experiments,
        "repeats": False,
        "cost": np.ones(n_cand),
        "budget": float(experiments),
    }
    return Exchange(Information(visits=visits, **told), experiments=experiments, **{**optional, **changes})


def as_counts(indices, n_cand):
    return np.bincount(list(indices), minlength=n_cand)

"""A drive whose arm bends beyond its gear, in places of different inertia, fitted by a model that may lack the bend."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cluster_systems import gather
from robid.clusters.evidence import Evidence
from robid.clusters.pooling import Pooled, estimate_between, pool

_S = 2j * np.pi * np.geomspace(2.0, 60.0, 40)
_STIFFNESS = 0.6 * (2 * np.pi * 12) ** 2
_DAMPING = 0.04 * np.sqrt(_STIFFNESS)
_NEAR, _FAR = 0.48, 0.4  # inertia before and beyond the bend
_NOISE, _ASSUMED = 0.003, 0.02
_STEP = 1e-5
_DESCENT, _WEIGHED = 4, 2
TRUE = np.array([0.02, 0.1])
"""Logarithms of stiffness and damping of the gear over their nominal values."""


def drive(values: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Motor acceleration per torque (n_cluster, n_line).

    Args:
        values: Logarithms of stiffness and damping, then compliance of the bend over that of the gear, one for all
            clusters or one each.
        inertia (n_cluster,): What the cluster makes of the inertia beyond the bend.
    """
    far = _FAR * inertia[:, None]
    bend = np.reshape(values[2], (-1, 1)) / _STIFFNESS
    arm = _NEAR + far / (1 + _S**2 * far * bend)
    gear = _STIFFNESS * np.exp(values[0]) + _DAMPING * np.exp(values[1]) * _S
    return _S**2 / (_S**2 + 1 / (1 / gear + 1 / (_S**2 * arm)))


@dataclass(frozen=True)
class Measured:
    """Clusters and what was measured there."""

    inertia: np.ndarray
    response: np.ndarray


def measure(n_cluster: int, bend: float, seed: int, spread: float = 0.0) -> Measured:
    """Measures a drive in random clusters; its bend varies between them by a logarithmic spread."""
    generator = np.random.default_rng(seed)
    inertia = np.exp(generator.uniform(-0.7, 0.7, n_cluster))
    own = bend * np.exp(generator.uniform(-spread, spread, n_cluster))
    response = drive((*TRUE, own), inertia)
    noise = generator.standard_normal((2, *response.shape)) * _NOISE / np.sqrt(2)
    return Measured(inertia, response * np.exp(noise[0] + 1j * noise[1]))


def evidence_at(measured: Measured, values: np.ndarray, precision: np.ndarray) -> Evidence:
    """What each cluster says of the first parameters, as many as `precision` has."""
    whole = np.concatenate([values, np.zeros(3 - values.size)])
    steps = _STEP * np.eye(3)[: values.size]
    columns = [np.log(drive(whole + step, measured.inertia) / drive(whole - step, measured.inertia)) for step in steps]
    derivative = np.stack(columns, axis=-1) / (2 * _STEP * _ASSUMED)
    residual = np.log(measured.response / drive(whole, measured.inertia)) / _ASSUMED
    clusters = [[index] for index in range(len(residual))]
    return gather(residual, derivative, clusters, np.diag(precision), -precision * values)


def fit(measured: Measured, precision: Sequence[float], between: np.ndarray | None = None) -> tuple[np.ndarray, Pooled]:
    """Fits stiffness and damping, with a third precision the bend too; differences between clusters are estimated.

    Args:
        measured: The clusters.
        precision: What is known of each parameter around zero, over its variance.
        between: Variances between clusters that are known, NaN where they are sought.
    """
    known = np.array(precision)
    values, variance = np.zeros(known.size), np.zeros(known.size)
    for step in range(_DESCENT + _WEIGHED):
        evidence = evidence_at(measured, values, known)
        if step >= _DESCENT:
            variance = estimate_between(evidence, between).variance
        pooled = pool(evidence, variance)
        values = values + np.clip(pooled.shift, -0.5, 0.5)
    return values, pooled

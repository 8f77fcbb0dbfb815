"""Clusters that differ: linear systems of known truth, written out densely, for tests of the statistics of clusters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from robid.clusters.evidence import Evidence


@dataclass(frozen=True)
class Dense:
    """All rows of all clusters as one linear model `y = X theta + e`, and its parts."""

    derivative: np.ndarray
    measured: np.ndarray

    @property
    def evidence(self) -> Evidence:
        """What each cluster says, around zero, nothing known beforehand."""
        n_param = self.derivative.shape[-1]
        return Evidence(self.derivative, self.measured, np.zeros((n_param, n_param)), np.zeros(n_param))

    def covariance(self, between: np.ndarray) -> np.ndarray:
        """Covariance of all rows."""
        return block_diag(*((np.eye(len(rows)) + (rows * between) @ rows.T) for rows in self.derivative))

    @property
    def stacked(self) -> np.ndarray:
        """All rows of the derivative."""
        return self.derivative.reshape(-1, self.derivative.shape[-1])


def dense_clusters(n_cluster: int, n_row: int, deviation: np.ndarray, seed: int, alike: bool = False) -> Dense:
    """Draws clusters whose parameters differ by a deviation (n_param,) about zero, measured with noise of one."""
    generator = np.random.default_rng(seed)
    n_param = deviation.size
    derivative = generator.standard_normal((1 if alike else n_cluster, n_row, n_param))
    derivative = np.repeat(derivative, n_cluster, axis=0) if alike else derivative
    own = deviation * generator.standard_normal((n_cluster, n_param))
    measured = (derivative @ own[..., None])[..., 0] + generator.standard_normal((n_cluster, n_row))
    return Dense(derivative, measured)


def gather(
    residual: np.ndarray,
    derivative: np.ndarray,
    clusters: Sequence[Sequence[int]],
    precision: np.ndarray,
    pull: np.ndarray,
) -> Evidence:
    """Compresses weighted residuals to what they say of the parameters.

    Args:
        residual (n_conf, ...): Measured minus modelled, over the deviation of its noise; `E|r|^2 = 1` for circular
            complex ones.
        derivative (n_conf, ..., n_param): Derivative of the model, weighted alike.
        clusters: Indices of the configurations of each cluster.
        precision (n_param, n_param): What is known beforehand, an inverse covariance.
        pull (n_param,): `precision` times how far that lies from the point.
    """
    n_param = derivative.shape[-1]
    found = [_compressed(residual[list(cluster)], derivative[list(cluster)], n_param) for cluster in clusters]
    return Evidence(np.array([rows for rows, _ in found]), np.array([left for _, left in found]), precision, pull)


def _compressed(residual: np.ndarray, derivative: np.ndarray, n_param: int) -> tuple[np.ndarray, np.ndarray]:
    stacked = np.concatenate([derivative.reshape(-1, n_param), residual.reshape(-1, 1)], axis=1)
    if np.iscomplexobj(stacked):
        stacked = np.sqrt(2) * np.concatenate([stacked.real, stacked.imag])
    triangle = np.zeros((n_param, n_param + 1))
    found = np.linalg.qr(stacked, mode="r")[:n_param]
    triangle[: len(found)] = found
    return triangle[:, :-1], triangle[:, -1]

"""What each cluster says of the parameters, to first order around a point, and how far it may say no more.

Measurements of a cluster have the same robot configuration, and weights saturate where evidence exceeds what differs
between clusters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from robid.arrays import ComplexArray, FloatArray

_NOTHING = 1e-12  # scaled information relative to the largest of a cluster, below which a cluster says nothing


@dataclass(frozen=True)
class Evidence:
    """What each cluster says, as few rows of unit noise: `target = rows (own - point) + noise`."""

    rows: FloatArray  # (n_cluster, n_row, n_param) Derivative of each row by the parameters, all noise of deviation one
    target: FloatArray  # (n_cluster, n_row) What is left of each row at the point
    precision: FloatArray  # (n_param, n_param) What is known beforehand, an inverse covariance; zero for nothing
    pull: FloatArray  # (n_param,) `precision` times how far what is known beforehand lies from the point

    @property
    def information(self) -> FloatArray:
        """Information (n_cluster, n_param, n_param) of each cluster."""
        return np.asarray(self.rows.swapaxes(1, 2) @ self.rows)

    @property
    def score(self) -> FloatArray:
        """Information times how far each cluster's own estimate lies from the point (n_cluster, n_param)."""
        return np.asarray((self.target[:, None] @ self.rows)[:, 0])


def summarise(
    bread: FloatArray, score: FloatArray, meat: FloatArray, precision: FloatArray, pull: FloatArray
) -> Evidence:
    """Takes what weighted estimates say whose weights are not the inverse of their errors' covariance.

    A cluster's own estimate lies `bread^-1 score` from the point, with the covariance `bread^-1 meat bread^-1`. Neither
    inverse need be there: a cluster may say nothing of some parameters.

    Args:
        bread (n_cluster, n_param, n_param): Weighted information of each cluster.
        score (n_cluster, n_param): Weighted residuals times their derivative, `bread` times the own estimate's shift.
        meat (n_cluster, n_param, n_param): Covariance of the score.
        precision (n_param, n_param): What is known beforehand, an inverse covariance.
        pull (n_param,): `precision` times how far that lies from the point.
    """
    scale = np.sqrt(np.maximum(np.diagonal(meat, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(meat / (scale[:, :, None] * scale[:, None]))
    kept = values > _NOTHING * np.maximum(values[:, -1:], 1e-300)
    root = np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    whiten = root[:, :, None] * vectors.swapaxes(1, 2) / scale[:, None]
    return Evidence(whiten @ bread, (whiten @ score[..., None])[..., 0], precision, pull)


_SAME_CONFIGURATION_RAD = 1e-3
Values = TypeVar("Values", FloatArray, ComplexArray)


def group_clusters(configurations: FloatArray) -> list[list[int]]:
    """Indices of the measurements in each cluster: joint angles (n_conf, n_joint) [rad] that agree."""
    clusters: list[list[int]] = []
    for index, angles in enumerate(configurations):
        for cluster in clusters:
            if np.abs(configurations[cluster[0]] - angles).max() < _SAME_CONFIGURATION_RAD:
                cluster.append(index)
                break
        else:
            clusters.append([index])
    return clusters


def spread_over(clusters: Sequence[Sequence[int]], values: Values) -> Values:
    """Values (n_conf, ...) of configurations from those of their clusters (n_cluster, ...)."""
    spread = np.empty((sum(map(len, clusters)), *values.shape[1:]), values.dtype)
    for cluster, own in zip(clusters, values, strict=True):
        spread[list(cluster)] = own
    return spread


_UNSEEN = 1e-13  # scaled information relative to the largest, below which nothing is said along a direction


@dataclass(frozen=True)
class Saturated:
    """What each cluster says once its parameters may differ from those of all clusters."""

    information: FloatArray  # (n_cluster, n_param, n_param) `(I^-1 + T)^-1` of each cluster
    score: FloatArray  # (n_cluster, n_param) It times how far each cluster's own estimate lies from the point
    square: FloatArray  # (n_cluster,) Square of the residuals over their covariance
    log_determinant: FloatArray  # (n_cluster,) Logarithm of that covariance's determinant


def saturated(evidence: Evidence, between: FloatArray) -> Saturated:
    """Weighs evidence by noise and by what differs between clusters.

    Args:
        evidence: What each cluster says.
        between (n_param,): Variance of each parameter between clusters.

    Source:
        Jackson, White and Thompson (2010), sec. 2: multivariate random-effects meta-analysis.
    """
    rows = evidence.rows
    covariance = np.eye(rows.shape[1]) + (rows * between) @ rows.swapaxes(1, 2)
    root = _root(covariance)
    whole = np.linalg.solve(root, np.concatenate([rows, evidence.target[..., None]], axis=2))
    weighted, left = whole[..., :-1], whole[..., -1]
    return Saturated(
        np.asarray(weighted.swapaxes(1, 2) @ weighted),
        np.asarray((left[:, None] @ weighted)[:, 0]),
        np.asarray((left**2).sum(axis=1)),
        np.asarray(2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)),
    )


def _root(covariance: FloatArray) -> FloatArray:
    """Cholesky factors of matrices (n_cluster, n_row, n_row) of at least the unit matrix, beyond all rounding or not.

    Where noise is next to nothing, rounding takes their smallest eigenvalues away: as little is then put back.
    """
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        size = covariance.shape[-1] * np.finfo(float).eps * np.trace(covariance, axis1=-2, axis2=-1)
        return np.linalg.cholesky(covariance + size[:, None, None] * np.eye(covariance.shape[-1]))


def saturate(information: FloatArray, between: FloatArray) -> FloatArray:
    """Returns `(I^-1 + T)^-1` of information (..., n_param, n_param) that need not have an inverse.

    Sums of it over clusters are what a choice of them is worth: it never exceeds `T^-1`. Of n visits to one cluster it
    is that of `n I`, at most n times that of I.

    Args:
        information (..., n_param, n_param): What each cluster says of its own parameters.
        between (n_param,): Variance of each parameter between clusters.
    """
    rows, root = _rows(information, between)
    weighted = np.linalg.solve(root, rows)
    return np.asarray(weighted.swapaxes(-1, -2) @ weighted)


def saturation_slope(information: FloatArray, between: FloatArray) -> FloatArray:
    """Returns the derivative of `saturate` by a factor on the information, where that is 1.

    It falls with the factor, so it bounds from above what more of the same cluster would add.

    Args:
        information (..., n_param, n_param): What each cluster says of its own parameters.
        between (n_param,): Variance of each parameter between clusters.
    """
    rows, root = _rows(information, between)
    weighted = np.linalg.solve(root.swapaxes(-1, -2), np.linalg.solve(root, rows))
    return np.asarray(weighted.swapaxes(-1, -2) @ weighted)


def _rows(information: FloatArray, between: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows R with `R'R = I`, and the triangular root of `1 + R T R'`."""
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 1e-300))
    values, vectors = np.linalg.eigh(information / (scale[..., :, None] * scale[..., None, :]))
    rows = np.sqrt(np.maximum(values, 0.0))[..., :, None] * vectors.swapaxes(-1, -2) * scale[..., None, :]
    covariance = np.eye(rows.shape[-1]) + (rows * between) @ rows.swapaxes(-1, -2)
    return np.asarray(rows), np.linalg.cholesky(covariance)


def inverted(total: FloatArray) -> tuple[FloatArray, float]:
    """Returns the inverse of information (n_param, n_param) and its log-determinant; zero where it is undetermined."""
    scale = np.sqrt(np.where(np.diag(total) > 0, np.diag(total), 1.0))
    scaled, known = total / (scale[:, None] * scale), 2 * np.log(scale).sum()
    # A triangular root tells whether all is determined: no eigenvalue is smaller beside the largest than the reciprocal
    # of the condition by the largest sum of a row. It costs a third of the eigenvalues.
    root, failed = dpotrf(scaled, lower=True)
    if not failed:
        inverse = _mirrored(dpotri(root, lower=True)[0])
        if np.abs(scaled).sum(axis=0).max() * np.abs(inverse).sum(axis=0).max() < 1 / _UNSEEN:
            return inverse / (scale[:, None] * scale), float(2 * np.log(np.diag(root)).sum() + known)
    values, vectors = np.linalg.eigh(scaled)
    kept = values > _UNSEEN * values[-1]
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T / (scale[:, None] * scale)
    return np.asarray(inverse), float(np.log(values[kept]).sum() + known)


def _mirrored(lower: FloatArray) -> FloatArray:
    """The symmetric matrix whose lower triangle is given."""
    return np.asarray(np.tril(lower) + np.tril(lower, -1).T)

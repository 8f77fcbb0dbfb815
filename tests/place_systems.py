"""Places that differ: linear systems of known truth, written out densely, for tests of the statistics of places."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from robid.places.evidence import Evidence, gather


@dataclass(frozen=True)
class Dense:
    """All rows of all places as one linear model `y = X theta + e`, and its parts."""

    derivative: np.ndarray
    measured: np.ndarray

    @property
    def evidence(self) -> Evidence:
        """What each place says, around zero, nothing known beforehand."""
        n_place, _, n_param = self.derivative.shape
        places = [[index] for index in range(n_place)]
        return gather(self.measured, self.derivative, places, np.zeros((n_param, n_param)), np.zeros(n_param))

    def covariance(self, between: np.ndarray) -> np.ndarray:
        """Covariance of all rows."""
        return block_diag(*((np.eye(len(rows)) + (rows * between) @ rows.T) for rows in self.derivative))

    @property
    def stacked(self) -> np.ndarray:
        """All rows of the derivative."""
        return self.derivative.reshape(-1, self.derivative.shape[-1])


def dense_places(n_place: int, n_row: int, deviation: np.ndarray, seed: int, alike: bool = False) -> Dense:
    """Draws places whose parameters differ by a deviation (n_param,) about zero, measured with noise of one."""
    generator = np.random.default_rng(seed)
    n_param = deviation.size
    derivative = generator.standard_normal((1 if alike else n_place, n_row, n_param))
    derivative = np.repeat(derivative, n_place, axis=0) if alike else derivative
    own = deviation * generator.standard_normal((n_place, n_param))
    measured = (derivative @ own[..., None])[..., 0] + generator.standard_normal((n_place, n_row))
    return Dense(derivative, measured)

"""Chirps with triangular amplitude."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray


def chirp(low: float, high: float, n_sample: int, *, peak: float = 0.25) -> FloatArray:
    """Returns a sine whose frequency rises linearly while its amplitude rises to one and falls to zero.

    Args:
        low: Frequency at the beginning [cycles per sample].
        high: Frequency at the end [cycles per sample].
        n_sample: Length.
        peak: Where the amplitude is largest, as a share of the length; 0 lets it fall throughout.

    Returns:
        The signal (n_sample,), `A(t) sin(2 pi f_1 t + pi (f_2 - f_1) t^2 / T_0)`.

    Source:
        Oliveira et al. (2019), eq. 2.
    """
    time = np.arange(n_sample)
    share = time / n_sample
    rising = share / peak if peak > 0 else np.ones(n_sample)
    amplitude = np.minimum(rising, (1 - share) / (1 - peak))
    return np.asarray(amplitude * np.sin(2 * np.pi * low * time + np.pi * (high - low) * time**2 / n_sample))

"""Responses averaged over realizations, their covariance estimated from them as from a record."""

from dataclasses import replace

import numpy as np

from robid.frf.covariance import element_scale, total_covariance

POOLED = 3


def complex_normal(generator, shape):
    """Circular complex normal numbers of unit variance."""
    return (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)


def averaged(frf, relative_noise, *, n_real=4, seed=0, common=0.0):
    """An exact response as the mean of noisy ones, one unit experiment per input and realization.

    `relative_noise` is each output's standard deviation in the mean over the median magnitude of the response;
    `common` is its share of the variance that all lines of an experiment have in common.
    """
    exact = frf.response
    n_conf, n_freq, n_out, n_in = exact.shape
    generator = np.random.default_rng(seed)
    level = relative_noise * np.sqrt(n_real) * np.median(np.abs(exact), axis=(0, 1, 3))[:, None]
    own = complex_normal(generator, (n_conf, n_real, n_freq, n_out, n_in))
    shared = complex_normal(generator, (n_conf, n_real, 1, n_out, n_in))
    noise = level * (np.sqrt(1 - common) * own + np.sqrt(common) * shared)
    mean = noise.mean(axis=1, keepdims=True)
    factor = np.broadcast_to(np.eye(n_in) / n_real, (n_freq, n_in, n_in))
    residual = noise - mean
    totals = [total_covariance(each, n_in, POOLED) for each in residual]
    parts = zip(residual, totals, strict=True)
    scales = [element_scale(each / n_real, factor, total, n_in) for each, (total, _) in parts]
    return replace(
        frf,
        response=exact + mean[:, 0],
        input_factor=np.broadcast_to(factor, (n_conf, *factor.shape)).astype(complex),
        element_scale=np.array(scales),
        total_covariance=np.array([total for total, _ in totals]),
        total_degrees_of_freedom=totals[0][1],
        realization_error=residual / n_real,
    )

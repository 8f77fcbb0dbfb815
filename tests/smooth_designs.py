"""Information of design candidates that depends smoothly on their angles."""

import numpy as np

SIZE = 26


def smooth_information(n_cand, seed=1):
    """Information of candidates at random in six angles, on which eight residuals of each depend smoothly."""
    generator = np.random.default_rng(seed)
    rates = generator.normal(size=(6, 8, SIZE))
    angles = generator.uniform(-1, 1, (n_cand, 6))
    jacobian = sum(np.cos(3 * angles[:, joint, None, None] * rates[joint]) for joint in range(6))
    return jacobian.swapaxes(1, 2) @ jacobian

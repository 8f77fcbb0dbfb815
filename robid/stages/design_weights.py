"""The weights of the fit that a choice of configurations is for, by the fit's own function."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact, read_outline
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.weights import make_weights

UNREAD = (
    "coherence",
    "silent_level",
    "silent_noise",
    "silent_interpolation",
    "uncompensated_response",
    "input_amplitude",
)
"""What no design reads of a response."""
_WEIGHED = (
    "configurations",
    "response",
    "input_factor",
    "element_scale",
    "total_covariance",
    "noise_covariance",
    "dropped",
)


def fit_weights(path: Path, options: ElasticOptions) -> FloatArray:
    """Weights (n_conf, n_freq, n_out, n_in) that the fit's own function gives all candidates together."""
    rows = []
    for row in range(read_outline(path, FRF).n_rows):
        frf = frf_from_artifact(read_artifact(path, FRF, row=row, leave_out=(*UNREAD, "realization_error")))
        rows.append({name: getattr(frf, name) for name in _WEIGHED})
    whole: dict[str, Any] = {
        name: None if rows[0][name] is None else np.concatenate([row[name] for row in rows]) for name in _WEIGHED
    }
    return make_weights(replace(frf, **whole), options.weights, options.residual)[0]

"""The weights of the fit that a choice of configurations is for, by the fit's own function."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact, read_outline
from robid.design.options import InformationOptions
from robid.families.elastic.settings import elastic_fit
from robid.fit.options import ElasticOptions, Weights
from robid.fit.weights import make_weights
from robid.settings.experiment import Design, Experiment

UNREAD = ("coherence", "silent_level", "silent_noise", "silent_doubt", "uncompensated_response", "input_amplitude")
"""What no design reads of a response."""
_WEIGHED = ("configurations", "response", "input_factor", "element_scale", "total_covariance", "noise_covariance")


def fit_options(experiment: Experiment, design: Design) -> ElasticOptions | None:
    """Returns the options of the fit whose weights a design is for: the named one, else one by user weights."""
    if design.weights.mean != "fit":
        return None
    if design.fit is not None:
        return elastic_fit(experiment, design.fit).options()
    own = design.weights
    return ElasticOptions(weights=Weights("user", off_diagonal=own.off_diagonal, low_cut_hz=own.low_cut_hz))


def about_options(experiment: Experiment, design: Design) -> InformationOptions:
    """Returns which information a design is made by, what is estimated along spelled out: as in the fit it names."""
    about, fit = design.about(), None if design.fit is None else elastic_fit(experiment, design.fit)
    along = about.along(None if fit is None else fit.free)
    held = () if fit is None or about.nuisance is not None else fit.fixed
    fixed = (*about.fixed, *(name for name in held if name.rpartition(".")[2] in along and name not in about.fixed))
    return replace(about, nuisance=along, fixed=fixed)


def prior_decades(fit: ElasticOptions | None) -> float:
    """What the fit takes as known of springs, dampers and link inertias; nothing without one [decades]."""
    return math.inf if fit is None else fit.prior_decades


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

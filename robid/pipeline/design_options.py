"""What a choice of configurations takes from the fit that it is for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from robid.design.configurations.options import InformationOptions
from robid.models.elastic.fit.options import ElasticOptions, Weights

if TYPE_CHECKING:
    from robid.settings.experiment import Design, Experiment


def fit_options(experiment: Experiment, design: Design) -> ElasticOptions | None:
    """Returns the options of the fit whose weights a design is for: the named one, else one by user weights."""
    from robid.models.elastic.settings import elastic_fit

    if design.weights.mean != "fit":
        return None
    if design.fit is not None:
        return elastic_fit(experiment, design.fit).options()
    own = design.weights
    return ElasticOptions(weights=Weights("user", off_diagonal=own.off_diagonal, low_cut_hz=own.low_cut_hz))


def about_options(experiment: Experiment, design: Design) -> InformationOptions:
    """Returns which information a design is made by, what is estimated along spelled out: as in the fit it names."""
    from robid.models.elastic.settings import elastic_fit

    about, fit = design.about(), None if design.fit is None else elastic_fit(experiment, design.fit)
    along = about.along(None if fit is None else fit.kinds)
    held = () if fit is None or about.nuisance is not None else fit.fixed
    fixed = (*about.fixed, *(name for name in held if name.rpartition(".")[2] in along and name not in about.fixed))
    return replace(about, nuisance=along, fixed=fixed)


def prior_decades(fit: ElasticOptions | None) -> float:
    """What the fit takes as known of springs, dampers and link inertias; nothing without one [decades]."""
    return math.inf if fit is None else fit.prior_decades

"""The fit of each kind of model to values in memory, by name: neither files nor settings are loaded."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robid.later import later
from robid.results.fitted import Fitted

with later(__name__):
    from robid.models.elastic.values import fit_values as _elastic
    from robid.models.external.values import fit_values as _external
    from robid.models.lpv.values import fit_values as _lpv
    from robid.models.rigid.values import fit_values as _rigid
    from robid.models.transmission.values import fit_values as _transmission

FITS: Mapping[str, Callable[..., Fitted]] = {
    "elastic": _elastic,
    "rigid": _rigid,
    "external": _external,
    "lpv": _lpv,
    "transmission": _transmission,
}
"""Functions that fit, by the name of the kind; imported with the first call."""

"""What a fit of each kind leaves of its data, by name of the kind: of a solution in memory, and of a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.later import later
from robid.results.residual import Residual

with later(__name__):
    from robid.models.elastic.residual import residual_of as _elastic
    from robid.models.elastic.residual import stored_residual as _stored_elastic
    from robid.models.external.residual import residual_of as _external
    from robid.models.external.residual import stored_residual as _stored_external
    from robid.models.lpv.residual import residual_of as _lpv
    from robid.models.lpv.residual import stored_residual as _stored_lpv
    from robid.models.rigid.residual import residual_of as _rigid
    from robid.models.rigid.residual import stored_residual as _stored_rigid
    from robid.models.transmission.residual import residual_of as _transmission
    from robid.models.transmission.residual import stored_residual as _stored_transmission

RESIDUALS: Mapping[str, Callable[[Any, Frf | None], Residual]] = {
    "elastic": _elastic,
    "rigid": _rigid,
    "external": _external,
    "lpv": _lpv,
    "transmission": _transmission,
}
"""By solution, and the responses that were fitted, if any."""
STORED_RESIDUALS: Mapping[str, Callable[[Artifact, Frf | None], Residual]] = {
    "elastic": _stored_elastic,
    "rigid": _stored_rigid,
    "external": _stored_external,
    "lpv": _stored_lpv,
    "transmission": _stored_transmission,
}
"""By the artifact of a model, and the responses that were fitted, if any."""

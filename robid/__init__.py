"""robid identifies the elastic dynamics of industrial robots from their own motor signals.

What is used from Python stands here, and is imported with its first use; where it is defined may change.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign
    from robid.errors import ArtifactError, DataError, RobidError, SettingsError
    from robid.face.control import from_control, to_control
    from robid.face.designs import choose_configurations
    from robid.face.fits import Fit, fit_model
    from robid.face.measured import make_responses, read_responses
    from robid.face.parameters import Parameter, Parameters
    from robid.face.responses import estimate_frf, make_record
    from robid.face.robots import RobotModel, load_robot
    from robid.face.runs import RunFolder, StoredFit, open  # noqa: A004  robid.open is meant to be read so
    from robid.frf.frf import Frf
    from robid.results.finding import Finding
    from robid.results.grade import Grade
    from robid.results.residual import Residual
    from robid.signals.record import Record
    from robid.versions import __version__

_PLACES = {
    "robid.design.configurations.information": ("ConfigurationDesign",),
    "robid.errors": ("ArtifactError", "DataError", "RobidError", "SettingsError"),
    "robid.face.control": ("from_control", "to_control"),
    "robid.face.designs": ("choose_configurations",),
    "robid.face.fits": ("Fit", "fit_model"),
    "robid.face.measured": ("make_responses", "read_responses"),
    "robid.face.parameters": ("Parameter", "Parameters"),
    "robid.face.responses": ("estimate_frf", "make_record"),
    "robid.face.robots": ("RobotModel", "load_robot"),
    "robid.face.runs": ("RunFolder", "StoredFit", "open"),
    "robid.frf.frf": ("Frf",),
    "robid.results.finding": ("Finding",),
    "robid.results.grade": ("Grade",),
    "robid.results.residual": ("Residual",),
    "robid.signals.record": ("Record",),
    "robid.versions": ("__version__",),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "ArtifactError",
    "ConfigurationDesign",
    "DataError",
    "Finding",
    "Fit",
    "Frf",
    "Grade",
    "Parameter",
    "Parameters",
    "Record",
    "Residual",
    "RobidError",
    "RobotModel",
    "RunFolder",
    "SettingsError",
    "StoredFit",
    "__version__",
    "choose_configurations",
    "estimate_frf",
    "fit_model",
    "from_control",
    "load_robot",
    "make_record",
    "make_responses",
    "open",
    "read_responses",
    "to_control",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    if name not in _MODULES:
        raise AttributeError(f"module `robid` has no attribute `{name}`; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

"""Transfer functions for python-control."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.errors import ArtifactError, SettingsError
from robid.models.external.files import solution_from_artifact

if TYPE_CHECKING:
    import control


def transfer_functions(path: str | Path, *, pade_order: int = 0) -> dict[str, control.TransferFunction]:
    """Reads the transfer functions of a fit as those of python-control.

    Args:
        path: The fit's `model.h5`.
        pade_order: Order of the Padé approximation of the delay; 0 leaves the delay out. The moving average of the
            commands is left out.

    Returns:
        Continuous transfer functions by the channel's name.

    Raises:
        SettingsError: If python-control is not installed.
        ArtifactError: If the model is of another family.
    """
    try:
        import control
    except ImportError as error:
        message = "python-control is not installed"
        raise SettingsError(message, remedy="install it with `pip install robid[control]`") from error
    artifact = read_artifact(Path(path), MODEL)
    if artifact.attributes["family"] != "external":
        message = f"the model is of family {artifact.attributes['family']}"
        raise ArtifactError(message, where=str(path), remedy="name the model of an external fit")
    solution = solution_from_artifact(artifact)
    own, found = solution.transfers, {}
    for block in range(len(own.blocks)):
        model = solution.transfer(block)
        late = control.TransferFunction(*control.pade(model.delay_samples * model.sampling_period_s, pade_order))
        for place, channel in enumerate(own.channels_of(block).tolist()):
            numerator = model.numerator.reshape(-1, model.numerator.shape[2])[place]
            found[own.names[channel]] = control.TransferFunction(numerator, model.denominator) * late
    return found

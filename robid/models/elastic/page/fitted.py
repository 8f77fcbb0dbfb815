"""What the page shows of a fitted model itself, found anew from its parameters: its modes, and residuals by line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robid.errors import DataError
from robid.models.elastic.files import new_resonances_from_artifact, resonances_from_artifact
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.fitting import model_at
from robid.models.elastic.judge.modes import ArmModes, arm_modes
from robid.models.elastic.judge.residuals import line_residuals
from robid.models.elastic.judge.resonances import ResonanceTable
from robid.models.elastic.settings import ElasticFit, elastic_fit
from robid.models.family import Shown
from robid.results.line_residuals import LineResiduals


@dataclass(frozen=True)
class Peak:
    """A measured resonance."""

    channel: str  # Name of the motor whose own response has it
    configuration: int  # Index of its configuration
    frequency_hz: float  # Where the magnitude is largest [Hz]


@dataclass(frozen=True)
class FittedViews:
    """Modes and residuals of a fitted model."""

    modes: tuple[ArmModes, ...] = ()  # Modes in each configuration of the fit; none where they are unknown
    springs: tuple[str, ...] = ()  # Names of the springs that their energy is in
    own: LineResiduals | None = None  # Residuals of the fit's own data, or None
    new: LineResiduals | None = None  # Those of its validation's, or None
    peaks: tuple[Peak, ...] = ()  # Measured resonances of the fit's own data
    new_peaks: tuple[Peak, ...] = ()  # Those of its validation's


def fitted_views(shown: Shown, solution: ElasticSolution) -> FittedViews:
    """Evaluates a fitted model on its own data and on those of its validation.

    Nothing is found where a fit took something of another one that is not there any more, or where no robot can have
    the fitted values, as after a fit to data in wrong units.
    """
    settings = elastic_fit(shown.data.loaded.experiment, shown.data.name)
    if not settings.takes.keys() <= shown.data.taken.keys():
        return FittedViews()
    try:
        return _views(shown, solution, settings)
    except DataError:
        return FittedViews()


def _views(shown: Shown, solution: ElasticSolution, settings: ElasticFit) -> FittedViews:
    fitted = model_at(shown.data, solution, settings.campaign)
    springs = tuple(spring.name for spring in fitted.robot.springs)
    own = FittedViews(
        arm_modes(fitted), springs, line_residuals(fitted), peaks=_peaks(resonances_from_artifact(shown.model))
    )
    if shown.validation is None or shown.new is None or settings.validate_on is None:
        return own
    lines = line_residuals(model_at(shown.new, solution, settings.validate_on))
    return replace(own, new=lines, new_peaks=_peaks(new_resonances_from_artifact(shown.validation)))


def _peaks(table: ResonanceTable | None) -> tuple[Peak, ...]:
    if table is None:
        return ()
    rows = zip(table.channel, table.kind, table.configuration.tolist(), table.measured_hz.tolist(), strict=True)
    return tuple(
        Peak(channel, configuration, hertz)
        for channel, kind, configuration, hertz in rows
        if kind == "resonance" and math.isfinite(hertz)
    )

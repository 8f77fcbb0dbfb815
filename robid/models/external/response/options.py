"""Options of fits to responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robid.arrays import option

Time = Literal["continuous", "discrete"]


@dataclass(frozen=True)
class ResponseFitOptions:
    """What is given of the structure of a fit to a response; None of what is chosen."""

    poles: int | None = option(None, "Number of poles, integrators included; chosen if absent", ge=0)
    zeros: int | None = option(None, "Number of zeros of every element; chosen if absent", ge=0)
    max_poles: int = option(8, "Largest number of poles tried", ge=1)
    time: Time = option("continuous", "Whether the model is in continuous or in discrete time")
    delay: float | None = option(
        None, "Delay: seconds in continuous, whole samples in discrete time; estimated if absent", ge=0
    )
    max_delay_s: float | None = option(
        None, "Longest delay searched [s]; five periods of the highest line if absent", ge=0
    )
    integrators: int | None = option(None, "Number of exact integrators; 0, 1 or 2, chosen, if absent", ge=0)
    relative_degree: int = option(
        0, "Least number of poles less zeros tried; negative for improper models, in continuous time only"
    )
    stable: bool = option(False, "Whether poles are kept stable; an unstable plant can be measured in closed loop")
    confidence: float = option(0.95, "Level of the intervals", gt=0, lt=1)

    def check(self) -> None:
        """Checks what cannot be asked for together.

        Raises:
            ValueError: If it cannot.
        """
        if self.relative_degree < 0 and self.time == "discrete":
            message = "Option `relative_degree` must not be negative in discrete time."
            raise ValueError(message)
        if self.delay is not None and self.time == "discrete" and self.delay != round(self.delay):
            message = "Option `delay` must be a whole number of samples in discrete time."
            raise ValueError(message)
        most = self.max_poles if self.poles is None else self.poles
        if self.integrators is not None and self.integrators > most:
            message = "Option `integrators` must not exceed the number of poles."
            raise ValueError(message)
        if self.zeros is not None and self.zeros > most - self.relative_degree:
            message = "Option `zeros` must not exceed the number of poles less `relative_degree`."
            raise ValueError(message)

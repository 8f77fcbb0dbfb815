"""The base of every settings model and the types they share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, StringConstraints

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Vector = tuple[float, float, float]


class Section(BaseModel):
    """A section of a settings file; it reaches into nested standard-library dataclasses too."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

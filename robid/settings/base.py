"""The base of every settings model and the types they share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, WithJsonSchema

from robid.arrays import option

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
DATA_VARIABLE = "${ROBID_DATA}"
DATA_DEFAULT = "../shared/data"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Place = Annotated[int, Field(ge=0), WithJsonSchema({"type": "integer", "minimum": 1})]
"""Number of a configuration: from 1 in the file, from 0 inside, see `robid.settings.numbering`."""
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)
"""What a section is that composes dataclasses of options."""

Vector = tuple[float, float, float]


class Section(BaseModel):
    """A section of a settings file; it reaches into nested standard-library dataclasses too."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def data_path(name: str, folder: Path) -> Path:
    """Returns the path of a file beside a settings file, or in the data folder for `${ROBID_DATA}` at its start."""
    if name.startswith(DATA_VARIABLE):
        return Path(os.environ.get("ROBID_DATA") or DATA_DEFAULT) / name.removeprefix(DATA_VARIABLE).lstrip("/")
    return folder / name


class Assumed(Section):
    """A section some of whose values no source gives."""

    assumed: tuple[str, ...] = option((), "Dotted names, within this section, of values without a source.")

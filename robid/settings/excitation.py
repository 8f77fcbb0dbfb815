"""The excitation of a campaign in an experiment file: one section for each signal, chosen by the key `signal`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

from pydantic import Discriminator, GetJsonSchemaHandler, Tag
from pydantic_core import CoreSchema

from robid.design.excitation.arbitrary import ArbitraryOptions
from robid.design.excitation.options import (
    ChirpOptions,
    FourierOptions,
    MultisineOptions,
    PoseChirpOptions,
    SteppedSineOptions,
    TrajectoryOptions,
)

_DEFAULT = "multisine"


def signal(value: Any) -> str:  # noqa: ANN401
    """Returns which signal a section is about; without the key it is a multisine."""
    if isinstance(value, Mapping):
        return str(value.get("signal", _DEFAULT))
    return str(getattr(value, "signal", _DEFAULT))


class _KeyUnlessDefault:
    """Requires the key in the JSON schema of every signal but the default, so that a section fits one of them."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core)
        for member in schema["oneOf"]:
            section = handler.resolve_ref_schema(member)
            if section["properties"]["signal"]["const"] != _DEFAULT:
                section["required"] = ["signal", *section.get("required", [])]
        return schema


ExcitationSettings: TypeAlias = Annotated[
    Annotated[MultisineOptions, Tag("multisine")]
    | Annotated[ChirpOptions, Tag("chirp")]
    | Annotated[SteppedSineOptions, Tag("stepped_sine")]
    | Annotated[FourierOptions, Tag("fourier")]
    | Annotated[TrajectoryOptions, Tag("trajectory")]
    | Annotated[PoseChirpOptions, Tag("pose_chirp")]
    | Annotated[ArbitraryOptions, Tag("arbitrary")],
    Discriminator(signal),
    _KeyUnlessDefault(),
]

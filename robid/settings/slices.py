"""The settings that a stage reads, as plain values, and their hash."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robid.settings.load import LoadedExperiment


def plain_settings(settings: object) -> Any:  # noqa: ANN401
    """Returns a settings model, an options dataclass or a container of them as values that JSON knows."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(settings, by_alias=True)


def settings_slice(loaded: LoadedExperiment, *sections: str) -> dict[str, Any]:
    """Returns the named parts of an experiment as values that JSON knows.

    Args:
        loaded: The experiment.
        *sections: Dotted names as in the files, `campaigns.estimation.excitation`; `robot` and what is below
            it is the robot file.

    Returns:
        The parts by the names asked for; None where a section is not given.

    Raises:
        KeyError: If there is no such section.
    """
    return {section: _part(loaded.plain, section) for section in sections}


def settings_hash(settings: object) -> str:
    """Returns the SHA-256 of a value's canonical JSON, as hexadecimal digits."""
    text = json.dumps(plain_settings(settings), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _part(plain: dict[str, Any], section: str) -> Any:  # noqa: ANN401
    node: Any = plain
    for key in section.split("."):
        node = node[key]
    return node

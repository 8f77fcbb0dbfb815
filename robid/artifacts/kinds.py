"""The kinds of artifacts before a fit: excitation, record, frequency response, design; and the task of a study.

What lies in them their dataclasses declare, see `robid.arrays.Quantity`: arrays and tuples become datasets, whose
units and axes their annotations declare; scalars become attributes, whose unit is part of their name; a tuple of
dataclasses becomes one dataset for each of their fields; None is left out. A field that a file of an older minor
version lacks gets its default.

Schema history:
    excitation:
        1.0: first version.
        1.1: in the plan, crest factor of the motor speed, signal-to-noise ratio of the response, and duration.
        1.2: in the plan of a trajectory, condition number of its regressor.
        1.3: `channels` of what is no motor: commands of the tool's pose; position reference of a travel beneath the
            excitation.
    record:
        1.0: first version.
        1.1: `accelerations`; trackers and accelerometers among the outputs.
        1.2: `truth_sha256`.
        2.0: each channel has its quantity, unit and side: `input_channels`, `output_channels`, `reference_channels`.
            `inputs`, `outputs`, `output_offset`, `input_hold` and `input_relative_std` were `torque`, `position`,
            `position_offset_rad`, `torque_hold` and `torque_relative_std`. A record may be one shot: without excited
            lines, and without configurations. `joint_units`, where joints are prismatic.
        2.1: `segments`: an arbitrary signal, one shot with lines.
        2.2: each channel has `sampled`: what its samples are.
    frf:
        1.0: first version.
        1.1: `coefficient_offset`, `uncompensated_response`, the torque laws; coherence, levels at the silent lines.
        1.2: `torque_amplitude`, `realization_error`.
        1.3: `mean_torque`, `mean_position`, `motion_rms`, `compensation`, `line_correlation`,
            `freedom_share`.
        2.0: each input and output has its quantity, unit and side: `input_channels`, `output_channels`; a response need
            not be one from torque to acceleration. `input_hold`, `input_amplitude`, `mean_input` and `mean_output` were
            `torque_hold`, `torque_amplitude`, `mean_torque` and `mean_position`. `joint_units`, where joints
            are prismatic.
        2.1: `dropped`.
        2.2: `saturated_inputs`, `saturated_outputs`.
        2.3: each channel has `sampled`: what its samples are.
        2.4: `line_scale`, of responses that were measured elsewhere.
    files:
        1.0: first version.
    design:
        1.0: first version.
        1.1: criterion, slopes, counts, gain, rounding loss; the gap is relative. Files of 1.0 are refused.
        1.2: `cost_s`, `stability`.
        1.3: `joint_units`, where joints are prismatic.
        1.4: `between_relative_std`, what parameters may differ by between configurations; `information` is without it.
        1.5: criterion `prediction`; `alternatives`, what other choices would give.
        1.6: `predict`, what a model is to predict; `alternatives` with `resonance_error`.
    task:
        1.0: first version.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from robid.arrays import Quantity, quantities
from robid.artifacts.artifact import Artifact, Attribute, Dataset, Kind, Provenance
from robid.errors import ArtifactError
from robid.later import imported, later

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

with later(__name__):
    from robid.design.configurations.information import ConfigurationDesign
    from robid.design.excitation.excitation import CampaignExcitation
    from robid.frf.files import ResponseFiles
    from robid.frf.frf import Frf
    from robid.signals.record import Record


Instance = TypeVar("Instance", bound="DataclassInstance")


def to_datasets(
    value: DataclassInstance, prefix: str = "", without: Collection[str] = ()
) -> tuple[dict[str, Dataset], dict[str, Attribute]]:
    """Takes a dataclass apart.

    Args:
        value: The dataclass; its fields are arrays and flat tuples, which declare a `Quantity`, scalars, None,
            dataclasses of these, or tuples of dataclasses of scalars, of which one declaration serves all fields.
        prefix: What it lies below, such as `grade/`.
        without: Fields that lie elsewhere.

    Raises:
        ValueError: If an array or a tuple declares nothing.
        TypeError: If a field is of another type.
    """
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {}
    kind = type(value)
    hints, declared = get_type_hints(kind), quantities(kind)
    for field in dataclasses.fields(value):
        name, content = prefix + field.name, getattr(value, field.name)
        if field.name in without or content is None:
            continue
        row, said = _row_type(hints[field.name]), declared.get(field.name)
        if dataclasses.is_dataclass(content) and not isinstance(content, type):
            inner = to_datasets(content, f"{name}/")
            datasets, attributes = datasets | inner[0], attributes | inner[1]
        elif isinstance(content, np.ndarray | tuple):
            if said is None:
                raise ValueError(f"`{kind.__name__}.{field.name}` declares no unit and axes.")
            unit = said.unit.format_map(value.own_units) if "{" in said.unit else said.unit  # type: ignore[attr-defined]
            # A tuple of dataclasses is one column for each of their fields.
            keys = [] if row is None else [one.name for one in dataclasses.fields(row)]
            rows: dict[str, Any] = {f"{name}/{key}": tuple(getattr(one, key) for one in content) for key in keys}
            datasets |= {key: _dataset(key, values, said, unit) for key, values in (rows or {name: content}).items()}
        elif isinstance(content, bool | int | float | str | np.generic):
            attributes[name] = content.item() if isinstance(content, np.generic) else content
        else:
            raise TypeError(f"`{kind.__name__}.{field.name}` is a {type(content).__name__}, which has no place here.")
    return datasets, attributes


def from_datasets(
    cls: type[Instance], artifact: Artifact, prefix: str = "", given: Mapping[str, object] | None = None
) -> Instance:
    """Puts a dataclass together again, from what lies below a prefix as `grade/` and values of other fields.

    Raises:
        ArtifactError: If the artifact lacks a field that has no default and may not be None.
    """
    missing: list[str] = []
    instance = _build(cls, artifact, prefix, missing, given)
    if instance is None or missing:
        what = f"A006 The {artifact.kind.name} lacks {', '.join(missing)}."
        remedy = f"make it again with `{artifact.kind.made_by} EXPERIMENT.yaml --force`"
        raise ArtifactError(what, remedy=remedy)
    return instance


def _row_type(hint: object) -> type[DataclassInstance] | None:
    inner = get_args(hint)[0] if get_origin(hint) is tuple and get_args(hint) else None
    return inner if isinstance(inner, type) and dataclasses.is_dataclass(inner) else None


def _build(
    cls: type[Instance], artifact: Artifact, prefix: str, missing: list[str], given: Mapping[str, object] | None = None
) -> Instance | None:
    hints = get_type_hints(cls)
    content: dict[str, Any] = dict(given or {})
    lacking = []
    for field in dataclasses.fields(cls):
        if field.name in content:
            continue
        path = prefix + field.name
        hint, optional = _without_none(hints[field.name])
        found = _find(hint, artifact, path, missing)
        if found is not None or optional:
            content[field.name] = found
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            lacking.append(path)
    missing += lacking
    return None if lacking else cls(**content)


def _find(hint: Any, artifact: Artifact, path: str, missing: list[str]) -> object:  # noqa: ANN401
    if path in artifact.datasets:
        values = artifact.datasets[path].values
        return tuple(values.tolist()) if get_origin(hint) is tuple else values
    if path in artifact.attributes:
        attribute = artifact.attributes[path]
        return float(attribute) if hint is float and isinstance(attribute, int) else attribute
    row = _row_type(hint)
    if row is not None:
        fields = dataclasses.fields(row)
        names = [field.name for field in fields if f"{path}/{field.name}" in artifact.datasets]
        if not names or any(field.name not in names and field.default is dataclasses.MISSING for field in fields):
            return None
        columns = (artifact.datasets[f"{path}/{name}"].values.tolist() for name in names)
        return tuple(row(**dict(zip(names, values, strict=True))) for values in zip(*columns, strict=True))
    if not (isinstance(hint, type) and dataclasses.is_dataclass(hint)):
        return None
    inside = any(name.startswith(f"{path}/") for name in (*artifact.datasets, *artifact.attributes))
    return _build(hint, artifact, f"{path}/", missing) if inside else None


def _dataset(name: str, content: np.ndarray[Any, Any] | tuple[Any, ...], said: Quantity, unit: str) -> Dataset:
    values = np.asarray(content, dtype=str if isinstance(content, tuple) and not content else None)
    if isinstance(content, tuple) and (values.ndim != 1 or values.dtype.kind not in "biufU"):
        raise TypeError(f"`{name}` must be a flat tuple of strings or numbers.")
    return Dataset(values, unit, tuple(said.axes.split()), said.meaning, said.compact)


def _without_none(hint: object) -> tuple[object, bool]:
    if get_origin(hint) not in (Union, types.UnionType):
        return hint, False
    members = [member for member in get_args(hint) if member is not types.NoneType]
    return (members[0] if len(members) == 1 else hint), len(members) < len(get_args(hint))


EXCITATION = Kind("excitation", "1.3", "robid design-excitation")
RECORD = Kind("record", "2.2", "robid simulate-or-acquire")
FRF = Kind("frf", "2.4", "robid estimate-frf")
FILES = Kind("files", "1.0", "robid simulate-or-acquire")
DESIGN = Kind("design", "1.6", "robid design-configs")
TASK = Kind("task", "1.0", "robid study")


def excitation_to_artifact(content: CampaignExcitation, provenance: Provenance) -> Artifact:
    """Turns a campaign's excitation into an artifact."""
    return Artifact(EXCITATION, *to_datasets(content), provenance)


def excitation_from_artifact(artifact: Artifact) -> CampaignExcitation:
    """The inverse of `excitation_to_artifact`, up to the rounding of the reference to float32."""
    return from_datasets(imported(CampaignExcitation), artifact)


def record_to_artifact(record: Record, provenance: Provenance) -> Artifact:
    """Turns a record into an artifact; its samples are stored compactly."""
    return Artifact(RECORD, *to_datasets(record), provenance)


def record_from_artifact(artifact: Artifact) -> Record:
    """The inverse of `record_to_artifact`, up to the rounding of the samples to float32."""
    return from_datasets(imported(Record), artifact)


def files_to_artifact(files: ResponseFiles, provenance: Provenance) -> Artifact:
    """Turns what files of responses hold into an artifact."""
    return Artifact(FILES, *to_datasets(files), provenance)


def files_from_artifact(artifact: Artifact) -> ResponseFiles:
    """The inverse of `files_to_artifact`."""
    return from_datasets(imported(ResponseFiles), artifact)


def frf_to_artifact(frf: Frf, provenance: Provenance) -> Artifact:
    """Turns a frequency response into an artifact."""
    return Artifact(FRF, *to_datasets(frf), provenance)


def frf_from_artifact(artifact: Artifact) -> Frf:
    """The inverse of `frf_to_artifact`."""
    return from_datasets(imported(Frf), artifact)


def design_to_artifact(design: ConfigurationDesign, provenance: Provenance) -> Artifact:
    """Turns a design into an artifact."""
    return Artifact(DESIGN, *to_datasets(design), provenance)


def design_from_artifact(artifact: Artifact) -> ConfigurationDesign:
    """The inverse of `design_to_artifact`."""
    return from_datasets(imported(ConfigurationDesign), artifact)

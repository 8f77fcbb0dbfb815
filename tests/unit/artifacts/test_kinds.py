"""Science objects to artifacts and back: the general mapping, the record, the frequency response."""

import dataclasses
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robid.arrays import Quantity, part_of
from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.kinds import (
    FRF,
    RECORD,
    frf_from_artifact,
    frf_to_artifact,
    from_datasets,
    record_from_artifact,
    record_to_artifact,
    to_datasets,
)
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import ArtifactError
from robid.frf.frf import Frf
from robid.signals.quantities import Channel, motor_channels
from robid.signals.record import Record
from tolerances import COMPACT

PROVENANCE = Provenance("stage")
KIND = Kind("thing", "1.0", "robid make-thing")


def _same_fields(left: object, right: object) -> None:
    for item in dataclasses.fields(left):
        one, other = getattr(left, item.name), getattr(right, item.name)
        assert type(one) is type(other), item.name
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other, err_msg=item.name)
            assert one.dtype == other.dtype
        else:
            assert one == other, item.name


def _record(generator: np.random.Generator, sizes: tuple[int, ...], *, with_reference: bool = True) -> Record:
    n_conf, n_real, n_exp, n_period, n_sample, n_in, n_out = sizes
    samples = (n_conf, n_real, n_exp, n_period, n_sample)
    reference = generator.standard_normal((n_conf, n_real, n_exp, n_sample, n_in))
    inputs = tuple(f"q{index}" for index in range(n_in))
    return Record(
        sampling_period_s=1e-3,
        configurations=generator.standard_normal((n_conf, 2)),
        inputs=300 * generator.standard_normal((*samples, n_in)),
        outputs=1e-2 * generator.standard_normal((*samples, n_out)),
        reference=reference if with_reference else None,
        reference_channels=motor_channels(inputs, "speed_reference") if with_reference else (),
        excited_lines=np.array([1, 3, 7]),
        detection_lines=np.array([], dtype=np.int64),
        input_channels=motor_channels(inputs, "current"),
        output_channels=motor_channels(tuple(f"q{index}" for index in range(n_out)), "angle"),
        output_offset=generator.standard_normal((n_conf, n_out)),
        notes=("first", "zweite Größe"),
    )


@given(sizes=st.tuples(*[st.integers(1, 3)] * 7), seed=st.integers(0, 1000), with_reference=st.booleans())
def test_a_record_comes_back(tmp_path_factory, sizes, seed, with_reference) -> None:
    path = tmp_path_factory.mktemp("record") / "record.h5"
    record = _record(np.random.default_rng(seed), sizes, with_reference=with_reference)
    write_artifact(path, record_to_artifact(record, PROVENANCE))
    found = record_from_artifact(read_artifact(path, RECORD))
    for name in ("inputs", "outputs", "reference"):
        one, other = getattr(record, name), getattr(found, name)
        if one is not None:
            np.testing.assert_allclose(other, one, rtol=0, atol=2 * COMPACT * np.max(np.abs(one)))
            assert other.dtype == np.float64
    samples = {"inputs": found.inputs, "outputs": found.outputs, "reference": found.reference}
    _same_fields(replace(record, **samples), found)


def test_a_record_of_one_shot_comes_back(tmp_path: Path) -> None:
    record = _record(np.random.default_rng(1), (1, 2, 1, 1, 5, 2, 3))
    sides = (Channel("q0", "angle", "rad"), Channel("tip", "position", "m", "tool"), Channel("q1", "speed", "rad/s"))
    shot = replace(record, configurations=None, excited_lines=np.zeros(0, int), output_channels=sides)
    write_artifact(tmp_path / "record.h5", record_to_artifact(shot, PROVENANCE))
    artifact = read_artifact(tmp_path / "record.h5", RECORD)
    assert artifact.datasets["outputs"].units == "rad; m; rad/s"
    found = record_from_artifact(artifact)
    assert found.is_one_shot
    assert found.configurations is None
    assert (found.input_channels, found.output_channels) == (shot.input_channels, sides)
    assert found.reference_channels == shot.reference_channels
    np.testing.assert_allclose(found.outputs, shot.outputs, rtol=0, atol=2 * COMPACT * np.max(np.abs(shot.outputs)))


@pytest.mark.parametrize("kind", [RECORD, FRF])
def test_files_of_schema_1_are_refused_with_what_to_do(tmp_path: Path, kind: Kind) -> None:
    path = tmp_path / "old.h5"
    write_artifact(path, Artifact(replace(kind, version="1.2"), {}, {}, PROVENANCE))
    with pytest.raises(
        ArtifactError, match=f"schema version 1.2; this robid reads 2.x of kind `{kind.name}`"
    ) as caught:
        read_artifact(path, kind)
    assert f"make it again with `{kind.made_by} EXPERIMENT.yaml --force`" in caught.value.remedy


def test_a_record_says_its_units_and_axes() -> None:
    datasets = record_to_artifact(_record(np.random.default_rng(1), (1,) * 7), PROVENANCE).datasets
    samples = ("configuration", "realization", "experiment", "period", "sample")
    assert (datasets["inputs"].units, datasets["inputs"].axes) == ("A", (*samples, "input"))
    assert (datasets["outputs"].units, datasets["outputs"].axes) == ("rad", (*samples, "output"))
    assert datasets["reference"].units == "rad/s"
    assert [name for name, dataset in datasets.items() if dataset.compact] == ["inputs", "outputs", "reference"]


def _frf(generator: np.random.Generator, *, coefficients: int, covariances: bool) -> Frf:
    def complex_values(*shape: int) -> np.ndarray:
        return generator.standard_normal(shape) + 1j * generator.standard_normal(shape)

    return Frf(
        frequency_hz=np.array([2.0, 3.5, 8.0]),
        lines=np.array([10, 17, 40]),
        configurations=generator.standard_normal((2, 6)),
        response=complex_values(2, 3, 3, 2),
        input_factor=complex_values(2, 3, 2, 2),
        element_scale=generator.uniform(0.5, 2.0, (2, 3, 2)),
        total_covariance=complex_values(2, 3, 3, 3) if covariances else None,
        noise_covariance=complex_values(2, 3, 3, 3) if covariances else None,
        total_degrees_of_freedom=18.0 if covariances else 0.0,
        noise_degrees_of_freedom=0,
        sensitivity=complex_values(2, coefficients, 3, 3, 2),
        coefficient_names=tuple(f"coulomb {index}" for index in range(coefficients)),
        coefficient_relative_std=np.full(coefficients, 0.15),
        removed_torque_rms=generator.standard_normal((2, 2)),
        sampling_period_s=1e-3,
        input_channels=motor_channels(("a", "b"), "torque"),
        output_channels=motor_channels(("a", "b", "load"), "acceleration"),
        notes=() if covariances else ("one realization",),
        realization_error=complex_values(2, 4, 3, 3, 2) if covariances else None,
    )


@pytest.mark.parametrize("coefficients", [0, 2])
@pytest.mark.parametrize("covariances", [True, False])
def test_a_frequency_response_comes_back_exactly(tmp_path: Path, coefficients: int, covariances: bool) -> None:
    frf = _frf(np.random.default_rng(1), coefficients=coefficients, covariances=covariances)
    write_artifact(tmp_path / "frf.h5", frf_to_artifact(frf, PROVENANCE))
    found = frf_from_artifact(read_artifact(tmp_path / "frf.h5", FRF))
    _same_fields(replace(frf, noise_degrees_of_freedom=0.0), found)


def test_a_frequency_response_says_its_units() -> None:
    frf = _frf(np.random.default_rng(1), coefficients=1, covariances=True)
    datasets = frf_to_artifact(frf, PROVENANCE).datasets
    assert datasets["response"].units == "rad/s^2/(N m)"
    assert datasets["response"].axes == ("configuration", "frequency", "output", "input")
    measured_in_amperes = frf_to_artifact(
        replace(frf, input_channels=motor_channels(("a", "b"), "current")), PROVENANCE
    ).datasets
    assert measured_in_amperes["response"].units == "rad/s^2/A"
    assert measured_in_amperes["removed_torque_rms"].units == "A"


def test_a_record_is_no_frequency_response(tmp_path: Path) -> None:
    record = _record(np.random.default_rng(1), (1,) * 7)
    write_artifact(tmp_path / "record.h5", record_to_artifact(record, PROVENANCE))
    with pytest.raises(ArtifactError, match="kind `record`, but `frf` is needed"):
        read_artifact(tmp_path / "record.h5", FRF)


@dataclass(frozen=True)
class Inner:
    level: float
    margin: Annotated[np.ndarray | None, Quantity("rad", "motor")] = None


@dataclass(frozen=True)
class Row:
    name: str
    size: float
    place: str = "here"


@dataclass(frozen=True)
class Outer:
    values: Annotated[np.ndarray, Quantity("{angle}", "parameter", "Angles")]
    names: Annotated[tuple[str, ...], Quantity("1", "parameter")]
    counts: Annotated[tuple[int, ...], Quantity("1", "start")]
    status: str
    converged: bool
    cost: float
    inner: Inner | None
    kind: str = "default"
    notes: Annotated[tuple[str, ...], Quantity("1", "note")] = field(default=("none",))
    optional: Annotated[np.ndarray | None, Quantity("1", "parameter")] = None
    rows: Annotated[tuple[Row, ...], Quantity("1", "row", "Rows")] = ()

    @property
    def own_units(self) -> dict[str, str]:
        return {"angle": "rad" if self.converged else "deg"}


@dataclass(frozen=True)
class Undeclared:
    values: np.ndarray


OUTER = Outer(np.ones(2), ("a", "b"), (1, 2), "converged", True, 3, Inner(2.0, np.zeros(3)), "x", ())
ROWS = replace(OUTER, rows=(Row("a", 1.5), Row("b", 2.5)))


@pytest.mark.parametrize(
    "value",
    [OUTER, replace(OUTER, inner=None), replace(OUTER, inner=Inner(1.0)), replace(OUTER, optional=np.eye(2)[0]), ROWS],
)
def test_any_dataclass_of_plain_values_comes_back(tmp_path: Path, value: Outer) -> None:
    datasets, attributes = to_datasets(value)
    write_artifact(tmp_path / "thing.h5", Artifact(KIND, datasets, attributes, PROVENANCE))
    found = from_datasets(Outer, read_artifact(tmp_path / "thing.h5", KIND))
    _same_fields(replace(value, inner=None, cost=3.0), replace(found, inner=None))
    if value.inner is None:
        assert found.inner is None
    else:
        _same_fields(value.inner, found.inner)


def test_a_field_of_a_newer_minor_version_gets_its_default() -> None:
    datasets, attributes = to_datasets(OUTER)
    del datasets["notes"], attributes["kind"]
    found = from_datasets(Outer, Artifact(KIND, datasets, attributes, PROVENANCE))
    assert (found.notes, found.kind) == (("none",), "default")
    datasets, attributes = to_datasets(replace(ROWS, rows=(Row("a", 1.5, "there"),)))
    del datasets["rows/place"]
    assert from_datasets(Outer, Artifact(KIND, datasets, attributes, PROVENANCE)).rows == (Row("a", 1.5),)
    del datasets["rows/size"]
    assert from_datasets(Outer, Artifact(KIND, datasets, attributes, PROVENANCE)).rows == ()


def test_missing_fields_are_named_together() -> None:
    datasets, attributes = to_datasets(OUTER)
    del datasets["values"], attributes["status"], attributes["inner/level"]
    with pytest.raises(ArtifactError, match="lacks inner/level, values, status") as caught:
        from_datasets(Outer, Artifact(KIND, datasets, attributes, PROVENANCE))
    assert "robid make-thing" in caught.value.remedy


def test_what_a_field_declares_is_what_its_dataset_says() -> None:
    datasets, _ = to_datasets(ROWS)
    said = {name: (dataset.units, dataset.axes, dataset.description) for name, dataset in datasets.items()}
    assert said["values"] == ("rad", ("parameter",), "Angles")
    assert said["inner/margin"] == ("rad", ("motor",), "")
    assert said["rows/name"] == said["rows/size"] == ("1", ("row",), "Rows")
    assert to_datasets(replace(OUTER, converged=False))[0]["values"].units == "deg"


def test_an_array_must_say_what_it_is() -> None:
    with pytest.raises(ValueError, match=r"`Undeclared\.values` declares no unit and axes"):
        to_datasets(Undeclared(np.zeros(1)))
    with pytest.raises(TypeError, match=r"`Outer\.names` is a list"):
        to_datasets(replace(OUTER, names=["a"]))
    with pytest.raises(TypeError, match="`names` must be a flat tuple"):
        to_datasets(replace(OUTER, names=(("a", "b"),)))


def test_a_part_of_an_axis_is_taken_of_all_that_have_it() -> None:
    part = part_of(replace(OUTER, optional=np.arange(2.0)), "parameter", np.array([1]))
    assert (part.values.shape, part.optional.tolist()) == ((1,), [1.0])
    assert (part.names, part.counts) == (("b",), OUTER.counts)

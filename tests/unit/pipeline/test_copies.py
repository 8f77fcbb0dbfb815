"""What a validation reads to find copies: each configuration once."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import record_to_artifact
from robid.artifacts.store import write_artifact
from robid.errors import DataError
from robid.pipeline import validate as copies
from robid.signals.quantities import Channel
from robid.signals.record import Record

FIT = SimpleNamespace(configurations=None)


def write(path, seeds, places):
    """A record with a configuration for each seed, of the same motion."""
    wave = np.sin(np.arange(400) ** 1.3 / 9)[:, None]
    samples = np.stack([wave + 0.01 * np.random.default_rng(seed).normal(size=(400, 1)) for seed in seeds])
    shaped = samples.reshape(len(seeds), 1, 1, 2, 200, 1)
    record = Record(
        sampling_period_s=1e-3,
        inputs=shaped,
        outputs=2 * shaped,
        output_offset=np.zeros((len(seeds), 1)),
        input_channels=(Channel("drive", "torque", "N m", "motor"),),
        output_channels=(Channel("drive", "angle", "rad", "motor"),),
        configurations=np.array([[place] for place in places]) if places else None,
        excited_lines=np.arange(1, 9) if places else np.zeros(0, int),
    )
    write_artifact(path, record_to_artifact(record, Provenance("acquire")))
    return path


@pytest.fixture
def reads(monkeypatch):
    counted, read = Counter(), copies._read

    def counting(path, row):
        counted[path.stem, row] += 1
        return read(path, row)

    monkeypatch.setattr(copies, "_read", counting)
    return counted


@pytest.mark.parametrize("places", [(), (0.1, 0.2, 0.3)])
def test_each_configuration_is_read_once(tmp_path, reads, places):
    seen = {
        name: write(tmp_path / f"{name}.h5", seeds, places) for name, seeds in {"a": (1, 2, 3), "b": (4, 5, 6)}.items()
    }
    new = write(tmp_path / "new.h5", (7, 8, 9), places)
    copies.refuse_copies(FIT, seen, new)
    assert reads == {(name, row): 1 for name in ("a", "b", "new") for row in range(3)}


def test_configurations_elsewhere_are_not_read(tmp_path, reads):
    seen = {"a": write(tmp_path / "a.h5", (1, 2), (0.1, 0.2))}
    copies.refuse_copies(FIT, seen, write(tmp_path / "new.h5", (1, 3), (0.5, 0.2)))
    assert reads == {("a", 1): 1, ("new", 1): 1}


def test_a_copy_is_refused_with_its_place(tmp_path, reads):
    seen = {"a": write(tmp_path / "a.h5", (1, 2), ()), "b": write(tmp_path / "b.h5", (3, 4), ())}
    with pytest.raises(DataError, match=r"configuration 2, realization 1, experiment 1 .* are those of `b`"):
        copies.refuse_copies(FIT, seen, write(tmp_path / "new.h5", (5, 4), ()))
    assert max(reads.values()) <= 3

"""Reads HDF5 files: datasets by their path, and of a matrix only the columns that were asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid.logs.formats.variables import Found, Reason, Wanted

_UNITS = ("units", "unit", "Unit", "Units", "unit_string")


def read(file: Path, wanted: Wanted) -> Found:
    """Reads the datasets of an HDF5 file."""
    found = Found()
    with h5py.File(file, "r") as root:

        def visit(name: str, item: Any) -> None:  # noqa: ANN401
            if isinstance(item, h5py.Dataset):
                try:
                    _take(name, item, wanted, found)
                except MemoryError:
                    raise
                except Exception as e:  # noqa: BLE001 a damaged dataset leaves the others readable
                    found.unreadable[name] = Reason(f"It is damaged ({e}).", "Write the log again from its source.")

        root.visititems(visit)
    return found


def _take(name: str, dataset: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds a dataset, each field of one whose elements are records."""
    unit = next((_text(dataset.attrs[key]) for key in _UNITS if key in dataset.attrs), "")
    for field in dataset.dtype.names or ("",):
        path = f"{name}.{field}" if field else name
        kind = dataset.dtype[field] if field else dataset.dtype
        if kind.kind not in "fiubc":
            found.unreadable[path] = Reason("It holds no numbers.")
        elif field and path in wanted:
            found.add(path, dataset[field], unit)
        elif field:
            found.mention(path, int(np.prod(dataset.shape)), unit)
        else:
            found.take(path, dataset, wanted, unit)


def _text(value: Any) -> str:  # noqa: ANN401
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)

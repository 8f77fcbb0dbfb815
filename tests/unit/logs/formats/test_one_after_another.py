"""Logs of all formats in one command: what one library keeps of memory leaves room for the next."""

import numpy as np
import pytest

from log_files import WRITERS
from robid.logs.formats.load import Reader

pytest.importorskip("pyarrow")


def test_every_format_is_read_after_parquet(tmp_path):
    time = 1e-3 * np.arange(500)
    log = {"time": time, "current": np.sin(time), "motor": np.cos(time)}
    reader = Reader()
    try:
        for kind, name in (
            ("parquet", "parquet"),
            ("arrow", "arrow"),
            ("mat", "mat"),
            ("hdf5", "hdf5"),
            ("tdms", "tdms"),
            ("mdf", "mdf"),
        ):
            if kind in ("tdms", "mdf"):
                pytest.importorskip({"tdms": "nptdms", "mdf": "asammdf"}[kind])
            (tmp_path / kind).mkdir()
            path, _ = WRITERS[kind][0](tmp_path / kind / WRITERS[kind][1], log)
            assert any(values.size == time.size for values in reader.read(path, name, None).arrays.values())
    finally:
        reader.close()

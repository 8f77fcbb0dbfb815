"""The documented way of an exported response into python-control, followed to the letter."""

import re
from pathlib import Path

import numpy as np
import pytest

from robid.pipeline.frf_formats import Response, response_mat
from sample_reports import arm_fit, bench_report

pytest.importorskip("control", reason="S068")

PAGE = Path(__file__).parents[2] / "docs/how-to/export-responses.md"


@pytest.mark.parametrize("frf", [arm_fit(2, 1, 20).frf, bench_report().fit.frf], ids=["six by six", "two by one"])
def test_the_documented_lines_make_the_response(frf, tmp_path, monkeypatch):
    numbers = tuple(range(len(frf.configurations)))
    (tmp_path / "frf.mat").write_bytes(response_mat(Response("arm", "estimation", (), numbers, frf)))
    (lines,) = re.findall(r"^```python\n(import control\n.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    monkeypatch.chdir(tmp_path)
    made = {}
    exec(lines, made)
    for index in (0, len(frf.lines) // 2):
        at = made["response"](2j * np.pi * frf.frequency_hz[index])
        np.testing.assert_allclose(np.reshape(at, frf.response.shape[2:]), frf.response[0, index], rtol=1e-12)

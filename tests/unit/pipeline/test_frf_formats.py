"""Exported responses with dropped lines, of translations, and with too little for a format."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError, SettingsError, require_module
from robid.pipeline.frf_formats import Response, response_json, response_tables
from robid.signals.quantities import Channel
from sample_reports import bench_report


@pytest.fixture(scope="module")
def response():
    """A command's response to a translation and an angle, at some lines of which too little was told."""
    frf = bench_report().fit.frf
    dropped = np.zeros((1, len(frf.lines), 1), bool)
    dropped[0, [5, 9]] = True
    channels = (Channel("cart", "position", "m", "tool"), Channel("cäble, long name", "angle", "rad", "tool"))
    inputs = (Channel("cart", "speed_reference", "m/s", "tool"),)
    changed = replace(frf, dropped=dropped, output_channels=channels, input_channels=inputs, joint_units=None)
    return Response("log", "estimation", (), (0,), changed)


def test_dropped_lines_are_not_numbers_in_tables_and_null_in_json(response):
    (table,) = response_tables(response)
    lines = table.decode().splitlines()
    header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    values = np.array(rows, float)
    assert header[1] == "cart per cart real [m/(m/s)]"
    for column in (1, 2):
        assert np.isnan(values[:, column]).nonzero()[0].tolist() == [5, 9]
    assert any("too little of an input are NaN" in line for line in lines)
    content = json.loads(response_json(response))
    for name in ("response_real", "response_imaginary", "variance"):
        assert content[name][0][5] == [[None], [None]], name
    assert content["dropped"][0][5] == [1.0]
    assert content["units"] == [["m/(m/s)"], ["rad/(m/s)"]]


def test_a_universal_file_leaves_dropped_lines_out(response, tmp_path):
    pyuff = pytest.importorskip("pyuff", reason="the extra uff is not installed")
    from robid.pipeline.frf_formats import response_uff

    path = tmp_path / "frf.uff"
    path.write_bytes(response_uff(response))
    _, *sets = pyuff.UFF(str(path)).read_sets()
    frf = response.frf
    kept = np.delete(np.arange(len(frf.lines)), [5, 9])
    for one in sets:
        np.testing.assert_allclose(one["x"], frf.frequency_hz[kept], rtol=1e-5)
    cart, _, cable, _ = sets
    np.testing.assert_allclose(cart["data"], frf.response[0, kept, 0, 0], rtol=1e-10)
    # Displacement over velocity, both of a translation; then an angle over it.
    assert (cart["ordinate_spec_data_type"], cart["ordinate_len_unit_exp"]) == (8, 1)
    assert (cart["orddenom_spec_data_type"], cart["orddenom_len_unit_exp"]) == (11, 1)
    assert (cable["ordinate_spec_data_type"], cable["ordinate_len_unit_exp"]) == (8, 0)
    assert cable["rsp_ent_name"] == "c?ble, lon"
    assert cable["id5"] == "unit rad/(m/s)"


def test_a_universal_file_cannot_hold_a_single_line(response):
    pytest.importorskip("pyuff", reason="the extra uff is not installed")
    from robid.pipeline.frf_formats import response_uff

    dropped = np.ones((1, len(response.frf.lines), 1), bool)
    dropped[0, 3] = False
    with pytest.raises(DataError, match="needs 2 lines; Configuration 1: joint 1 0 deg has 1"):
        response_uff(replace(response, frf=replace(response.frf, dropped=dropped)))


def test_a_missing_module_names_what_installs_it():
    require_module("numpy", "none", "Counting")
    with pytest.raises(SettingsError) as caught:
        require_module("no_such_module", "some", "Counting")
    assert "Counting needs the package no_such_module" in caught.value.what
    assert caught.value.remedy == "install it with `pip install 'robid[some]'`"


def test_the_phrase_of_an_estimate_is_about_the_lines_that_tell():
    from robid.pipeline.estimate_frf import _brief, _phrase

    frf = bench_report().fit.frf
    most = np.arange(len(frf.lines))[None, :, None] % 3 > 0
    for dropped in (None, most):
        told = _phrase([_brief(replace(frf, dropped=dropped))])
        assert "standard deviation" in told
        assert "inf" not in told
        assert "nan" not in told

"""What CONTRIBUTING says that an addition takes is where an addition goes: walked for five of them."""

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from robid.logs.formats.variables import FORMATS
from robid.models.elastic.fit.nuisance import kinds, listing
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.known import FAMILIES
from robid.robot.friction import LAWS, Curve, Friction, LawName, stacked_coefficients
from robid.settings.load import load_robot
from robid.signals.log_options import LogFormat

ROOT = Path(__file__).parents[2]
ROWS = dict(re.findall(r"^\| (an? [^|]+?) \| (.+) \|$", (ROOT / "CONTRIBUTING.md").read_text(), re.M))


def paths(row):
    return [path for path in re.findall(r"`((?:robid|tests|configs)/[^`]+)`", ROWS[row]) if "<name>" not in path]


@pytest.mark.parametrize("row", ROWS)
def test_every_path_is_there(row):
    for path in paths(row):
        every = [path.replace("<kind>", kind) for kind in FAMILIES] if "<kind>" in path else [path]
        # A family may have no exports of its own, and then no module that writes them.
        assert any((ROOT / one).exists() for one in every), path


def test_a_name_that_stands_in_code_is_in_the_file_beside_it():
    for row in ROWS.values():
        for name, path in re.findall(r"`([A-Z]\w+)` \(`(robid/[^`]+\.py)`\)", row):
            assert hasattr(import_module(path.removesuffix(".py").replace("/", ".")), name), (name, path)


def test_a_family_is_its_row_and_its_room():
    for name, family in FAMILIES.items():
        assert family.name == name
        room = ROOT / "robid" / "models" / name
        parts = {path.stem for path in room.iterdir()}
        assert {"fit", "judge", "page", "settings", "files", "family"} <= parts


def test_an_export_is_a_row_of_its_family():
    exports = [export for family in FAMILIES.values() for export in family.exports.values()]
    assert len(exports) > len(FAMILIES)
    assert all(Path(export.file).suffix in export.suffixes for export in exports)


def test_a_log_format_is_its_row_and_its_name():
    assert set(FORMATS) == set(get_args(LogFormat))
    for name, one in FORMATS.items():
        module, _, function = one.reader.partition(":")
        assert callable(getattr(import_module(module), function)), name


def test_a_friction_law_is_its_row_and_its_name(monkeypatch):
    assert set(LAWS) == set(get_args(LawName))
    worn = Curve("worn", sign_share=0.3, breaks_away=False, knots=12)
    monkeypatch.setitem(LAWS, "worn", worn)
    stated = Friction(coulomb_nm=2.0, static_nm=3.0, stribeck_rad_s=0.5, presliding_rad=0.01)
    speed = np.array([[-2.0], [-0.15], [0.0], [0.15], [2.0]])
    expected = 2.0 * np.tanh(speed / 0.15)
    found = LAWS["worn"].periodic_torque(speed, 1e-3, stacked_coefficients(LAWS["worn"], [stated]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    # The engine takes its polygon as that of any other curve.
    ramps = LAWS["worn"].in_engine(stated)
    polygon = np.clip(ramps.slope * speed, -ramps.level, ramps.level).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(polygon, expected, atol=0.02)


def test_a_nuisance_parameter_is_a_row(monkeypatch):
    robot = load_robot(ROOT / "configs" / "robots" / "kr300.yaml").to_robot(None)
    before = [one.name for one in listing.list_nuisances(robot, ElasticOptions())]
    owners, rows = kinds.DELAY
    clock = replace(rows[0], ending="clock", title="offset of the clocks", parameter="")
    monkeypatch.setattr(listing, "WIDENING", (*kinds.WIDENING, (owners, (clock,))))
    after = listing.list_nuisances(robot, ElasticOptions())
    assert [one.name for one in after] == [*before, "clock"]
    assert after[-1].effect == rows[0].effect(robot)

import os
import time

import pytest

from robid.errors import DataError
from robid.robot.foreign import read_model

_BODY = '<body name="b"><joint name="j" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{}</body>'
_MODEL = "<mujoco>{}<worldbody>{}" + _BODY.format("") + "</worldbody></mujoco>"
_REPLICATE = '<replicate count="{}" euler="0 0 1">{}</replicate>'
_MESH = '<compiler meshdir="{}"/><asset><mesh name="m" file="{}"/></asset>'


def _model(folder, above: str = "", inside: str = ""):
    path = folder / "model.xml"
    path.write_text(_MODEL.format(above, inside), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("above", "inside"),
    [
        ("", _REPLICATE.format(1_000_000_000, '<geom size="1"/>')),
        ("", _REPLICATE.format(1000, _REPLICATE.format(1000, '<geom size="1"/>'))),
        ('<size nuserdata="2000000000"/>', ""),
        ('<include file="pipe"/>', ""),
        ('<include file="model.xml"/>', ""),
        (_MESH.format(".", "pipe"), ""),
        (_MESH.format("below", "pipe"), ""),
        (_MESH.format(".", "/dev/zero"), ""),
    ],
)
def test_models_that_wait_or_repeat_without_end_are_refused_at_once(tmp_path, above, inside):
    (tmp_path / "below").mkdir()
    for folder in (tmp_path, tmp_path / "below"):
        os.mkfifo(folder / "pipe")
    begun = time.monotonic()
    with pytest.raises(DataError, match=r"D20[01]"):
        read_model(_model(tmp_path, above, inside))
    assert time.monotonic() - begun < 5.0


def test_a_few_copies_and_meshes_that_are_not_there_are_read(tmp_path):
    inside = _REPLICATE.format(20, '<geom size="0.01" mass="0.1"/>')
    model = read_model(_model(tmp_path, "", inside))
    assert model.driven == ("j",)

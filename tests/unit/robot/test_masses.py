"""Masses, inertias, gravity and limits of rigid files: as MuJoCo has them, or told."""

import mujoco
import numpy as np
import pytest

from robid.errors import DataError
from robid.robot.chain import extract_chain
from robid.robot.foreign import read_model
from robid.robot.model import quiet_reading

ARM = """<mujoco>
  <compiler {compiler}/>
  <option {option}/>
  <worldbody>
    <body name="upper"><inertial pos="0.1 0 0" mass="4" diaginertia="{upper}"/><joint name="lift" axis="0 1 0" {lift}/>
      <geom size="0.1"/>
      <body name="cover" pos="0 0 0.1"><inertial pos="0 0 0" mass="{cover}" diaginertia="0.01 0.01 0.01"/></body>
      <body name="lower" pos="0.4 0 0"><joint name="bend" axis="0 1 0"/><geom size="0.05" density="3000"/>
        <body name="finger" pos="0.2 0 0"><joint name="grip" type="slide" axis="0 1 0"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
PLAIN = {"compiler": "", "option": "", "upper": "0.1 0.2 0.2", "lift": "", "cover": "0.5"}


def read(tmp_path, text=None, name="arm.xml", **changes):
    path = tmp_path / name
    path.write_text(ARM.format(**{**PLAIN, **changes}) if text is None else text)
    return read_model(path)


def masses(model):
    return {model.compiled.body(i).name: model.weights.mass_kg[i] for i in range(1, model.compiled.nbody)}


def mujocos(**changes):
    """Masses and traces of the inertias as MuJoCo has them; the finger has something so that it compiles."""
    text = ARM.format(**{**PLAIN, **changes})
    finger = '<body name="finger" pos="0.2 0 0">'
    if "boundmass" not in text:
        text = text.replace(finger, f'{finger}<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>')
    with quiet_reading():
        compiled = mujoco.MjModel.from_xml_string(text)
    return compiled.body_mass[1:], compiled.body_inertia[1:].sum(axis=1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, []),
        ({"compiler": 'settotalmass="30"'}, ["settotalmass", "30"]),
        ({"compiler": 'boundmass="0.7" boundinertia="0.15"'}, ["boundmass", "boundinertia"]),
        ({"compiler": 'inertiafromgeom="true"'}, ["taken from geometry", "upper"]),
        ({"compiler": 'balanceinertia="true"'}, []),
    ],
)
def test_masses_are_those_of_mujoco_and_what_changed_them_is_told(tmp_path, changes, words):
    model = read(tmp_path, **changes)
    mass, trace = mujocos(**changes)
    np.testing.assert_allclose(model.weights.mass_kg[1:], mass, atol=1e-8)
    np.testing.assert_allclose(model.weights.inertia_kgm2[1:].trace(axis1=1, axis2=2), trace, atol=1e-7)
    told = "\n".join(model.notes)
    assert all(word in told for word in words)
    assert not model.faults


def test_a_link_that_takes_no_mass_from_its_shape_has_none(tmp_path):
    assert masses(read(tmp_path, compiler='inertiafromgeom="false"'))["lower"] == 0


def test_a_link_without_mass_that_is_locked_adds_nothing(tmp_path):
    model = read(tmp_path)
    chain = extract_chain(model, ["lift", "bend"], {"grip": 0.0})
    ball = 3000 * 4 / 3 * np.pi * 0.05**3
    assert chain[1].link.mass_kg == pytest.approx(ball, rel=1e-12)
    np.testing.assert_allclose(chain[1].link.inertia_kgm2, 0.4 * ball * 0.05**2 * np.eye(3), rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "body", "words"),
    [
        ({"upper": "0.1 0.2 0.4"}, "upper", "sum of the others"),
        ({"upper": "0.1 0.2 0.4", "compiler": 'balanceinertia="true"'}, "upper", "balanceinertia"),
        ({"upper": "0.1 -0.2 0.2"}, "upper", "none is negative"),
        ({"cover": "0"}, "cover", "inertia but no mass"),
    ],
)
def test_what_no_body_has_is_told_by_name(tmp_path, changes, body, words):
    model = read(tmp_path, **changes)
    assert list(model.faults) == [body]
    assert words in model.faults[body]


def test_a_medium_and_compensated_weight_are_listed(tmp_path):
    text = ARM.format(**{**PLAIN, "option": 'density="1.2" wind="1 0 0"'}).replace('"upper"', '"upper" gravcomp="1"', 1)
    told = "\n".join(read(tmp_path, text).notes)
    for words in ("density, wind", "gravcomp of bodies left out", "upper"):
        assert words in told


@pytest.mark.parametrize(
    ("option", "wanted"),
    [
        ("", (0, 0, -9.81)),
        ('gravity="9.81 0 0"', (9.81, 0, 0)),
        ('gravity="0 0 0"', (0, 0, 0)),
        ('timestep="0.001"><flag gravity="disable"/></option><option', (0, 0, 0)),
    ],
)
def test_gravity_is_that_of_the_file(tmp_path, option, wanted):
    assert read(tmp_path, option=option).gravity == wanted


@pytest.mark.parametrize("limits", ['range="2 -2"', 'limited="true" range="1 1"'])
def test_limits_that_cannot_be_are_told_by_joint(tmp_path, limits, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = read(tmp_path, lift=limits)
    assert list(model.limit_faults) == ["lift"]
    assert "".join(capfd.readouterr()) == ""
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]


def test_what_has_no_name_gets_one(tmp_path):
    text = ARM.format(**PLAIN).replace(' name="upper"', "").replace(' name="bend"', "").replace(' name="lower"', "")
    model = read(tmp_path, text)
    assert len({*model.hinges, *model.slides, *masses(model)}) == 3 + 4
    assert "" not in (*model.hinges, *masses(model))


URDF = """<?xml version="1.0"?>
<robot name="arm">
  {more}
  <link name="base"/>
  <link name="l1"><inertial><mass value="3"/><inertia ixx="0.1" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://$(find arm)/l1.dae"/></geometry></visual></link>
  <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="30" velocity="2"/></joint>
  {end}
</robot>"""


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<mujoco><compiler settotalmass="9" balanceinertia="true"/></mujoco>', "settotalmass"),
        ('<mujoco><compiler boundmass="9"/></mujoco>', "boundmass"),
        ('<mujoco><option gravity="0 -9.81 0"/></mujoco>', ""),
        ('<gazebo reference="l1"/><transmission name="t"><joint name="j1"/></transmission>', ""),
    ],
)
def test_simulators_change_nothing_of_a_urdf_but_gravity(tmp_path, more, words):
    model = read(tmp_path, URDF.format(more=more, end=""), "arm.urdf")
    assert masses(model)["l1"] == 3
    assert words in "\n".join(model.notes)
    assert model.gravity == ((0, -9.81, 0) if "gravity" in more else (0, 0, -9.81))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_urdf_may_be_encoded_as_xml_may(tmp_path, encoding):
    text = URDF.format(more="", end="").replace('"1.0"', f'"1.0" encoding="{encoding.removesuffix("-sig")}"')
    (tmp_path / "arm.urdf").write_bytes(text.encode(encoding))
    assert masses(read_model(tmp_path / "arm.urdf"))["l1"] == 3


JOINT = '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>'


@pytest.mark.parametrize(
    ("more", "end", "words"),
    [
        ("<xacro:include xmlns:xacro='http://www.ros.org/wiki/xacro' filename='a'/>", "", "D257"),
        ("<xacro:property name='m' value='1'/>", "", "D257"),
        ("", '<link name="l1"/>', "more than one link `l1`"),
        ("", '<link name="lost"/>', "`base`, `lost`"),
        ("", JOINT.format(name="j2", kind="fixed", parent="base", child="l1", more=""), "`l1` hangs on 2 joints"),
        ("", JOINT.format(name="j2", kind="hinge", parent="l1", child="l2", more=""), "type `hinge`"),
        (
            '<link name="l2"/>',
            JOINT.format(name="j2", kind="prismatic", parent="l1", child="l2", more='<mimic joint="j9"/>'),
            "mimics `j9`",
        ),
    ],
)
def test_a_urdf_that_is_no_tree_says_why(tmp_path, more, end, words):
    with pytest.raises(DataError) as caught:
        read(tmp_path, URDF.format(more=more, end=end), "arm.urdf")
    assert words in caught.value.what


def test_other_descriptions_are_called_what_they_are(tmp_path):
    with pytest.raises(DataError) as caught:
        read(tmp_path, '<sdf version="1.7"><model name="a"/></sdf>', "arm.sdf")
    assert "`sdf`" in caught.value.what


def test_what_mujoco_warns_of_is_kept_from_screen_and_log_file_and_told(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    compile_now = mujoco.MjSpec.compile

    def warning(spec):
        compile_now(mujoco.MjSpec.from_string('<mujoco><compiler settotalmass="1"/></mujoco>'))
        return compile_now(spec)

    monkeypatch.setattr("mujoco.MjSpec.compile", warning)
    assert "settotalmass" in "\n".join(read(tmp_path).notes)
    assert "".join(capfd.readouterr()) == ""
    assert [path.name for path in tmp_path.iterdir()] == ["arm.xml"]

"""A folder to begin with: from an example, or from a rigid model."""

import numpy as np
import pytest

from answers import ask
from log_files import write_csv
from robid.models.known import load_experiment
from robid.robot.parameters import PARAMETER_KINDS
from robid.scaffold.examples import EXAMPLES, examples_folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_is_a_folder_of_two_files_that_load(here, example):
    told = ask("init", "first", "--example", example, "--json").json
    assert sorted(path.name for path in (here / "first").iterdir()) == sorted(told["files"])
    assert sorted(told["files"]) == ["first.yaml", "first_robot.yaml"]
    loaded = load_experiment(here / "first/first.yaml")
    source = load_experiment(examples_folder() / EXAMPLES[example])
    assert loaded.experiment.name == "first"
    assert loaded.experiment.campaigns == source.experiment.campaigns
    assert loaded.robot == source.robot
    for command in told["next"]:
        assert command.endswith("first/first.yaml")
    assert ask(*told["next"][0].split()[1:]).code == 0


def test_a_folder_that_holds_something_stays_as_it_is(here):
    (here / "mine").mkdir()
    (here / "mine/robot.yaml").write_text("kept")
    answer = ask("init", "mine", "--example", "drive")
    assert (answer.code, "S553" in answer.err) == (2, True)
    assert [(path.name, path.read_text()) for path in (here / "mine").iterdir()] == [("robot.yaml", "kept")]


def test_an_empty_folder_is_filled(here):
    (here / "mine").mkdir()
    assert ask("init", "mine", "--example", "drive").code == 0
    assert (here / "mine/mine.yaml").is_file()


@pytest.mark.parametrize(
    ("name", "options", "code"),
    [("mine", (), "S555"), ("a b", ("--example", "drive"), "S551"), ("file", ("--example", "drive"), "S552")],
)
def test_what_cannot_be_begun_leaves_nothing(here, name, options, code):
    (here / "file").write_text("kept")
    answer = ask("init", name, *options)
    assert (answer.code, code in answer.err) == (2, True)
    assert [path.name for path in here.iterdir()] == ["file"]


def test_a_folder_below_a_file_is_refused(here):
    (here / "file").write_text("kept")
    answer = ask("init", "file/inside", "--example", "drive")
    assert (answer.code, "S552" in answer.err) == (2, True)


SCARA = """
<robot name="scara">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.15 0 0"/><mass value="5"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.055" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="forearm"><inertial><origin xyz="0.12 0 0"/><mass value="4"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.035" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="quill"><inertial><mass value="0.8"/>
    <inertia ixx="0.004" iyy="0.004" izz="0.0002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><mass value="0.4"/>
    <inertia ixx="0.0004" iyy="0.0004" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.3"/><limit lower="-2.2" upper="2.2" velocity="6" effort="120"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="forearm"/><axis xyz="0 0 1"/>
    <origin xyz="0.3 0 0"/><limit lower="-2.5" upper="2.5" velocity="9"/></joint>
  <joint name="lift" type="prismatic"><parent link="forearm"/><child link="quill"/><axis xyz="0 0 1"/>
    <origin xyz="0.25 0 0"/><limit lower="-0.2" upper="0"/></joint>
  <joint name="wrist" type="continuous"><parent link="quill"/><child link="hand"/><axis xyz="0 0 1"/></joint>
</robot>
"""


def begun(folder, text, file="scara.urdf", name="mine"):
    """Writes a model and begins with it; returns what was told."""
    (folder / file).write_text(text)
    answer = ask("init", name, "--model", file, "--json")
    assert answer.code == 0, answer.err
    return answer.json


def test_a_model_becomes_a_robot_whose_guesses_are_marked(here):
    told = begun(here, SCARA)
    assert sorted(path.name for path in (here / "mine").iterdir()) == ["mine.yaml", "mine_robot.yaml", "scara.urdf"]
    (here / "scara.urdf").unlink()
    assert ask("status", "mine/mine.yaml").code == 0
    robot = load_experiment(here / "mine/mine.yaml").robot
    assert [joint.name for joint in robot.joints] == ["shoulder", "elbow", "lift", "wrist"]
    assert [joint.slides for joint in robot.joints] == [False, False, True, False]
    shoulder, elbow, lift, wrist = robot.joints
    assert shoulder.motor.max_torque_nm * shoulder.motor.gear_ratio == pytest.approx(120)
    assert shoulder.motor.max_speed_rad_s == pytest.approx(6 * shoulder.motor.gear_ratio)
    assert {"max_torque_nm", "max_speed_rad_s"}.isdisjoint(shoulder.motor.assumed)
    assert "max_torque_nm" in elbow.motor.assumed
    assert {"gear_ratio_rad_m", "max_speed_rad_s", "max_torque_nm"} <= set(lift.motor.assumed)
    assert wrist.assumed == ("limits_deg",)
    for joint in robot.joints:
        assert {"inertia_kgm2", "friction"} < set(joint.motor.assumed)
        fields = [PARAMETER_KINDS[kind].fields[joint.slides] for kind in ("stiffness", "damping")]
        assert joint.gear.assumed == tuple(fields)
    assert any("wrist" in step for step in told["steps"])


def two_axes(text):
    """The first two axes of a SCARA alone."""
    head, _, tail = text.partition('  <link name="quill">')
    return head + tail[tail.index('  <joint name="shoulder"') : tail.index('  <joint name="lift"')] + "</robot>"


@pytest.mark.parametrize("model", [two_axes(SCARA), pytest.param(SCARA, marks=pytest.mark.slow)], ids=["two", "scara"])
def test_the_experiment_runs_as_it_is_written(here, model):
    begun(here, model)
    answer = ask("run", "mine/mine.yaml", "--json", "--backend", "serial")
    assert answer.code == 0, answer.err
    assert [node["grade"] for node in answer.json["nodes"] if node["grade"] is not None] == [2]


def test_configurations_are_chosen_of_a_robot_whose_joints_do_not_all_move_each_other(here):
    begun(here, SCARA)
    answer = ask("design-configs", "mine/mine.yaml", "--json")
    assert answer.code == 0, answer.err


def test_every_joint_has_one_line_and_its_columns_stand_below_each_other(here):
    begun(here, SCARA)
    text = (here / "mine/mine_robot.yaml").read_text()
    rows = [line for line in text.splitlines() if line.startswith("  - {name: ")]
    assert len(rows) == 4
    for key in ("gear: {", "motor: {inertia", "friction: {", "ripple_nm"):
        assert len({row.index(key) for row in rows}) == 1, key


MODELS = ("mjcf_meshfree/xarm7_nohand.xml", "urdf_meshfree/staubli_tx60.urdf", "urdf_meshfree/abb_irb1200_5_90.urdf")


@pytest.mark.parametrize("model", MODELS)
def test_models_of_known_robots_are_accepted(here, data_folder, monkeypatch, model):
    path = data_folder("robot_models").absolute() / model
    monkeypatch.delenv("ROBID_DATA", raising=False)
    answer = ask("init", "mine", "--model", str(path))
    assert answer.code == 0, answer.err
    assert (here / "mine" / path.name).read_bytes() == path.read_bytes()
    assert ask("status", "mine/mine.yaml").code == 0
    robot = load_experiment(here / "mine/mine.yaml").robot
    assert len(robot.joints) == (7 if "xarm7" in model else 6)
    assert robot.flange in ("tool0", "attachment_site")


INCLUDED = '<mujoco><worldbody><body name="tip"><inertial pos="0 0 0.1" mass="1" diaginertia="1e-2 1e-2 1e-3"/>\
<joint name="tilt" axis="0 1 0" range="-60 60"/></body></worldbody></mujoco>'
OUTER = '<mujoco><include file="parts/arm.xml"/></mujoco>'


def test_what_a_model_includes_comes_along(here):
    (here / "parts").mkdir()
    (here / "parts/arm.xml").write_text(INCLUDED)
    begun(here, OUTER, "robot.xml")
    (here / "parts/arm.xml").unlink()
    assert sorted(path.name for path in (here / "mine").iterdir()) == ["mine.yaml", "mine_robot.yaml", "robot.xml"]
    robot = load_experiment(here / "mine/mine.yaml").robot
    assert [(joint.name, joint.link.mass_kg) for joint in robot.joints] == [("tilt", 1.0)]


FINGERS = """<mujoco><worldbody><body><joint name="a" axis="0 0 1" range="-90 90"/>{mass}
<body pos="1 0 0"><joint name="b" axis="0 1 0" range="-90 90"/>{mass}
<body pos="1 0 0"><joint name="left" type="slide" axis="0 1 0" range="0 0.1"/>{mass}</body>
<body pos="1 0 0"><joint name="right" type="slide" axis="0 1 0" range="0 0.1"/>{mass}</body>
</body></body></worldbody></mujoco>"""
MASS = '<inertial pos="0.5 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>'


def test_fingers_are_held(here):
    told = begun(here, FINGERS.replace("{mass}", MASS), "hand.xml")
    robot = load_experiment(here / "mine/mine.yaml").robot
    assert [joint.name for joint in robot.joints] == ["a", "b"]
    assert set(robot.held) == {"left", "right"}
    assert any("left" in step and "right" in step for step in told["steps"])


@pytest.mark.parametrize(
    ("file", "text", "exit_code", "code"),
    [
        ("none.urdf", None, 4, "D280"),
        ("bad.urdf", "no robot", 4, "D201"),
        ("still.urdf", '<robot name="still"><link name="base"/></robot>', 4, "D283"),
        ("empty.urdf", SCARA.replace('mass value="4"', 'mass value="0"'), 2, "S556"),
        ("loop.xml", '<mujoco><include file="loop.xml"/></mujoco>', 4, "D281"),
    ],
)
def test_a_model_that_is_no_robot_leaves_nothing(here, file, text, exit_code, code):
    if text is not None:
        (here / file).write_text(text)
    answer = ask("init", "mine", "--model", file)
    assert (answer.code, code in answer.err) == (exit_code, True), answer.err
    assert not (here / "mine").exists()


def test_an_example_has_a_robot_of_its_own():
    answer = ask("init", "mine", "--model", "scara.urdf", "--example", "drive")
    assert (answer.code, "S557" in answer.err) == (2, True)


def log_of(names, n_period=4):
    """A log of motors that a multisine moves: torques, and angles that follow them."""
    count, rng = 1000, np.random.default_rng(1)
    columns = {"time_s": np.arange(count * n_period) * 1e-3}
    for torque, angle in names:
        lines = np.zeros(count // 2 + 1, complex)
        lines[5:80:2] = np.exp(2j * np.pi * rng.random(38))
        inertia = np.ones_like(lines)
        inertia[1:] = -((2 * np.pi * np.arange(1, len(lines))) ** 2) * 1e-3
        columns[torque] = np.tile(np.fft.irfft(lines, count), n_period) * 50
        columns[angle] = np.tile(np.fft.irfft(lines / inertia, count), n_period) * 50
    return columns


@pytest.mark.parametrize("names", [("shoulder", "elbow"), ("j1", "j2")])
def test_a_log_gives_the_experiment_with_the_joints_of_the_robot(here, names):
    write_csv(here / "bench.csv", log_of([(f"torque_{name}[Nm]", f"angle_{name}[rad]") for name in names]))
    (here / "arm.urdf").write_text(two_axes(SCARA))
    answer = ask("init", "mine", "--model", "arm.urdf", "--log", "bench.csv", "--json")
    assert answer.code == 0, answer.err
    assert ask("status", "mine/mine.yaml").code == 0
    loaded = load_experiment(here / "mine/mine.yaml")
    assert [joint.name for joint in loaded.robot.joints] == ["shoulder", "elbow"]
    campaign = loaded.experiment.campaigns["log"]
    acquire = campaign.source.acquire
    assert [channel.name for channel in acquire.inputs] == ["shoulder", "elbow"]
    assert [channel.variable for channel in acquire.inputs] == [f"torque_{name}[Nm]" for name in names]
    assert [channel.name for channel in acquire.outputs] == ["shoulder", "elbow"]
    assert acquire.log_path(here / "mine").resolve() == here / "bench.csv"
    assert campaign.excitation.period_s == 1
    assert any("configurations" in step for step in answer.json["steps"])
    assert any("is shoulder" in step for step in answer.json["steps"]) == (names[0] == "j1")


LIFTS = """
<robot name="lifts">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="6"/>
    <inertia ixx="0.01" iyy="0.09" izz="0.09" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="forearm"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.3"/><limit lower="-2.2" upper="2.2" velocity="4" effort="120"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="forearm"/><axis xyz="0 1 0"/>
    <origin xyz="0.4 0 0"/><limit lower="-2.5" upper="2.5" velocity="6" effort="40"/></joint>
</robot>
"""


def motion_of(urdf, ratio, repeats):
    """A log of joints that move far and slowly, with friction and rotors, `ratio` times as fast where motors are."""
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromXML(urdf)
    data, step, period, rng = model.createData(), 4e-3, 5.0, np.random.default_rng(3)
    omega, time = 2 * np.pi * np.arange(1, 6) / period, np.arange(0, 4 * period, step)
    omega = omega if repeats else omega * np.array([1, 1.19, 0.93, 1.07, 1.13])
    parts, phases = rng.uniform(0.1, 0.3, (2, 5)), rng.uniform(0, 2 * np.pi, (2, 5))
    angles = omega[:, None] * time + phases[..., None]
    q, v, a = (
        np.einsum("jk,jkt->tj", parts * factor, wave(angles))
        for factor, wave in ((1, np.sin), (omega, np.cos), (-(omega**2), np.sin))
    )
    torque = np.array([pinocchio.rnea(model, data, *one) for one in zip(q, v, a, strict=True)])
    torque += 0.3 * a + 2 * v + 1.5 * np.tanh(v / 0.01) + 0.05 * rng.normal(size=v.shape)
    columns = {"time [s]": time}
    for joint, name in enumerate(("shoulder", "elbow")):
        columns |= {f"angle_{name}[rad]": q[:, joint] * ratio, f"torque_{name}[Nm]": torque[:, joint] / ratio}
    return columns


@pytest.mark.parametrize("repeats", [True, False])
@pytest.mark.parametrize(("ratio", "side"), [(1, ".arm"), (100, "")])
def test_a_motion_of_all_joints_is_fitted_rigidly_on_the_side_of_the_gears_that_was_logged(here, repeats, ratio, side):
    write_csv(here / "motion.csv", motion_of(LIFTS, ratio, repeats))
    (here / "arm.urdf").write_text(LIFTS)
    answer = ask("init", "mine", "--model", "arm.urdf", "--log", "motion.csv", "--json")
    assert answer.code == 0, answer.err
    told = (here / "mine/mine.yaml").read_text()
    for name in ("shoulder", "elbow"):
        assert told.count(f"{{name: {name}{side}, ") == 2
    loaded = load_experiment(here / "mine/mine.yaml")
    assert [fit.family for fit in loaded.experiment.fits.values()] == ["rigid"]
    assert any(".arm" in step for step in answer.json["steps"]) == bool(side)


def test_metres_and_newtons_of_a_slide_are_the_arms(here):
    rng, time = np.random.default_rng(5), np.arange(0, 10, 2e-3)
    columns = {"time [s]": time}
    for name, size, inertia, units in (
        ("shoulder", 1.0, 0.8, ("rad", "Nm")),
        ("elbow", 0.9, 0.3, ("rad", "Nm")),
        ("lift", 0.08, 2.0, ("m", "N")),
        ("wrist", 1.5, 0.01, ("rad", "Nm")),
    ):
        omega, phases = 2 * np.pi * np.array([0.3, 0.7]), rng.uniform(0, 2 * np.pi, (2, 1))
        q, v = (size / 2 * wave(omega[:, None] * time + phases) for wave in (np.sin, np.cos))
        speed = omega @ v
        effort = inertia * (-(omega**2) @ q) + 2 * inertia * speed + 3 * inertia * np.sign(speed)
        columns |= {f"pos_{name}[{units[0]}]": q.sum(axis=0), f"effort_{name}[{units[1]}]": effort}
    write_csv(here / "motion.csv", columns)
    (here / "arm.urdf").write_text(SCARA)
    answer = ask("init", "mine", "--model", "arm.urdf", "--log", "motion.csv", "--json")
    assert answer.code == 0, answer.err
    loaded = load_experiment(here / "mine/mine.yaml")
    assert [fit.family for fit in loaded.experiment.fits.values()] == ["rigid"]
    assert (here / "mine/mine.yaml").read_text().count("{name: lift.arm, ") == 2


def test_a_log_of_other_axes_leaves_their_names_to_be_given(here):
    write_csv(here / "bench.csv", log_of([("torque[Nm]", "angle[rad]")]))
    (here / "arm.urdf").write_text(two_axes(SCARA))
    answer = ask("init", "mine", "--model", "arm.urdf", "--log", "bench.csv", "--json")
    assert answer.code == 0, answer.err
    assert ask("status", "mine/mine.yaml").code == 0
    assert load_experiment(here / "mine/mine.yaml").experiment.robot is None
    assert "# robot: mine_robot.yaml" in (here / "mine/mine.yaml").read_text()


def test_a_log_that_cannot_be_mapped_leaves_nothing(here):
    rng = np.random.default_rng(1)
    write_csv(here / "bench.csv", {"a": rng.standard_normal(500), "b": rng.standard_normal(500)})
    (here / "arm.urdf").write_text(two_axes(SCARA))
    answer = ask("init", "mine", "--model", "arm.urdf", "--log", "bench.csv")
    assert (answer.code, "S558" in answer.err) == (2, True), answer.err
    assert not (here / "mine").exists()


def test_a_log_alone_does_not_say_which_robot():
    answer = ask("init", "mine", "--log", "bench.csv")
    assert (answer.code, "S559" in answer.err) == (2, True)

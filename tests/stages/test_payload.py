"""A payload from records with and without it, and the robots that a rigid fit is exported as."""

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robid.artifacts.results import MODEL, estimate_from_artifact
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.models.known import load_experiment
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fitting import values_in
from robid.robot.chain import extract_chain
from robid.robot.foreign import read_model
from robid.robot.regressor.links import COMPONENTS, standard_parameters
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from tolerances import RECOVERY_SIGMA

HERE = Path(__file__).parent
PAYLOAD = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


@pytest.fixture
def carrier(shop):
    for name in ("carrier_robot.yaml", "payload.yaml"):
        shutil.copy(HERE / name, shop.folder)
    shop.experiment, shop.runs = "payload.yaml", shop.folder / "runs" / "payload"
    return shop


@pytest.fixture(scope="module")
def carried(tmp_path_factory, workshop):
    """A run that many tests look at."""
    with pytest.MonkeyPatch.context() as patch:
        shop = workshop(tmp_path_factory.mktemp("carried"), patch)
        for name in ("carrier_robot.yaml", "payload.yaml"):
            shutil.copy(HERE / name, shop.folder)
        shop.experiment, shop.runs = "payload.yaml", shop.folder / "runs" / "payload"
        answer = shop.robid("run", "payload.yaml")
        assert answer.code == 0, answer.err
        yield shop


def test_the_payload_comes_out_with_all_of_its_parameters(carried):
    model = read_artifact(carried.runs / "fits" / "carried" / "model.h5", MODEL)
    estimate, folder = estimate_from_artifact(model), carried.runs / "loaded"
    true = read_truth(folder / "truth.json", folder / "record.h5")
    truth = values_in(load_experiment(carried.folder / "payload.yaml"), "carried", true)
    std = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)).tolist(), strict=True))
    for component in PAYLOAD:
        name = f"payload.{component}"
        assert abs(estimate.found[name] - truth[name]) < RECOVERY_SIGMA * std[name], name
    assert truth["payload.M"] == pytest.approx(10.0), "the truth is a quarter heavier than the robot file says"
    assert std["payload.M"] < 0.05


def exported(shop, form):
    answer = shop.robid("export", "payload.yaml", "--format", form)
    assert answer.code == 0, answer.err
    return (
        shop.runs / "fits" / "carried" / "export" / {"robot": "robot.yaml", "urdf": "robot.urdf"}.get(form, "robot.xml")
    )


def found_and_base(shop):
    solution = solution_from_artifact(read_artifact(shop.runs / "fits" / "carried" / "model.h5", MODEL))
    return solution, solution.base.combination @ solution.standard.value


def test_the_exported_robot_file_has_the_estimated_base_parameters(carried):
    solution, base = found_and_base(carried)
    loaded = load_experiment(carried.folder / "payload.yaml")
    robot = load_robot(exported(carried, "robot")).to_robot()
    again = build_rigid_model(robot, loaded.experiment.fits["carried"].model)
    offsets = np.array([name.endswith("offset") for name in solution.estimate.names])
    again_base = solution.base.combination @ again.nominal
    np.testing.assert_allclose(again_base[~offsets], base[~offsets], rtol=1e-9, atol=1e-12)
    std = np.sqrt(np.diag(solution.estimate.covariance))
    assert (np.abs(again_base - solution.estimate.value)[~offsets] < 0.5 * std[~offsets]).all()


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_an_exported_model_read_back_has_the_same_base_parameters(carried, form):
    """The links of the file with the fit's motors: URDF has no place for rotor inertias."""
    solution, base = found_and_base(carried)
    loaded = load_experiment(carried.folder / "payload.yaml")
    names = [joint.name for joint in loaded.robot.joints]
    chain = extract_chain(read_model(exported(carried, form)), names, {})
    robot = load_robot(exported(carried, "robot")).to_robot()
    last = chain[-1].link
    assert last.mass_kg == pytest.approx(robot.joints[-1].link.mass_kg + robot.payload.mass_kg)
    # The payload is in the last link: as one body its parameters count for link and payload.
    standard = dict(zip(solution.base.standard, solution.standard.value, strict=True))
    for found, joint in zip(chain, names, strict=True):
        own = np.array([standard[f"{joint}.{one}"] for one in COMPONENTS])
        if joint == names[-1]:
            own = own + [standard[f"payload.{one}"] for one in COMPONENTS]
        np.testing.assert_allclose(standard_parameters(found.link), own, rtol=1e-8, atol=1e-9 * np.abs(own).max())
    assert base.size == len(solution.estimate.names)


def test_mujoco_and_pinocchio_move_the_exported_models_with_the_fits_torques(carried):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    loaded = load_experiment(carried.folder / "payload.yaml")
    solution, _ = found_and_base(carried)
    robot = loaded.robot.to_robot(8.0)
    model = build_rigid_model(robot, loaded.experiment.fits["carried"].model)
    values = np.where(["offset" in name for name in model.names], 0.0, solution.standard.value)
    generator = np.random.default_rng(0)
    arm = generator.uniform(-1, 1, (3, 6, 3))
    wanted = model.torques(values, *(arm @ robot.motor_per_arm.T))
    compiled = mujoco.MjModel.from_xml_path(str(exported(carried, "mjcf")))
    urdf = pin.buildModelFromUrdf(str(exported(carried, "urdf")))
    data, foreign = mujoco.MjData(compiled), urdf.createData()
    standard = dict(zip(solution.base.standard, solution.standard.value, strict=True))
    rotor, viscous = (
        np.array([standard[f"{joint.name}.{kind}"] for joint in robot.joints]) for kind in ("motor_inertia", "viscous")
    )
    for torque, position, speed, acceleration in zip(wanted, *arm, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = position, speed, acceleration
        mujoco.mj_inverse(compiled, data)
        np.testing.assert_allclose(data.qfrc_inverse / robot.gear_ratio, torque, rtol=1e-9, atol=1e-10)
        links = pin.rnea(urdf, foreign, position, speed, acceleration) / robot.gear_ratio
        own = links + robot.gear_ratio * (rotor * acceleration + viscous * speed)
        np.testing.assert_allclose(own, torque, rtol=1e-9, atol=1e-10)


def test_campaigns_whose_payloads_make_no_sense_are_told_with_their_place(carrier):
    carrier.change("from: [unloaded, loaded]", "from: [loaded]", "payload.yaml")
    text = "fits.carried.from: S091 names no campaign without payload"
    carrier.refuse(2, text, command=("run", "payload.yaml"))
    carrier.change("from: [loaded]", "from: [unloaded]", "payload.yaml")
    carrier.refuse(2, "S091 names no campaign with payload", command=("run", "payload.yaml"))
    carrier.change("from: [unloaded]", "from: [unloaded, loaded, other]", "payload.yaml")
    carrier.change("    validate_on: other\n", "", "payload.yaml")
    carrier.change("other: {<<: *motion, payload_kg: 8", "other: {<<: *motion, payload_kg: 5", "payload.yaml")
    carrier.refuse(2, "payloads of 5, 8 kg: one body is one of them, or none", command=("run", "payload.yaml"))
    carrier.change("[unloaded, loaded, other]", "[unloaded, loaded]\n    validate_on: other", "payload.yaml")
    carrier.refuse(2, "has a payload of 5 kg, which the fit never saw", command=("run", "payload.yaml"))
    carrier.change("payload: body, ", "", "payload.yaml")
    carrier.refuse(2, "S200", command=("run", "payload.yaml"))


def test_a_payload_that_changes_makes_the_fit_stale(carried):
    carried.change("loaded: {<<: *motion, payload_kg: 8", "loaded: {<<: *motion, payload_kg: 8.0001", "payload.yaml")
    carried.change("other: {<<: *motion, payload_kg: 8", "other: {<<: *motion, payload_kg: 8.0001", "payload.yaml")
    try:
        status, why = carried.states()["fits/carried/model.h5"]
        assert status == "stale"
        assert "campaigns.loaded.payload_kg" in why
    finally:
        text = (carried.folder / "payload.yaml").read_text()
        (carried.folder / "payload.yaml").write_text(text.replace("8.0001", "8"))

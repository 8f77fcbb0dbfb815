"""Gains of motors from a known payload, in a run: estimated, shown, exported, and used on a new motion."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from robid.artifacts.results import MODEL, estimate_from_artifact
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.models.known import load_experiment
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fitting import values_in
from tolerances import RECOVERY_SIGMA

HERE = Path(__file__).parent
FACTORS = {"waist": 1.15, "shoulder": 0.87, "elbow": 1.06}


def _start(shop):
    for name in ("carrier_robot.yaml", "payload.yaml"):
        shutil.copy(HERE / name, shop.folder)
    shop.experiment, shop.runs = "payload.yaml", shop.folder / "runs" / "payload"
    wrong = f"{{elbow: 0.9}}, torque_constant_factor: {json.dumps(FACTORS)}"
    shop.change("{payload: 1.25, elbow: 0.9}", wrong, "payload.yaml")
    shop.change("    instruments: none\n", "    instruments: none\n    gain_std: 0.1\n", "payload.yaml")


@pytest.fixture(scope="module")
def corrected(tmp_path_factory, workshop):
    """A run whose torques are recorded by wrong constants, with the payload that the robot file has."""
    with pytest.MonkeyPatch.context() as patch:
        shop = workshop(tmp_path_factory.mktemp("corrected"), patch)
        _start(shop)
        answer = shop.robid("run", "payload.yaml")
        assert answer.code == 0, answer.err
        yield shop, answer.out


def _model(shop):
    return read_artifact(shop.runs / "fits" / "carried" / "model.h5", MODEL)


def test_gains_and_parameters_of_wrong_constants_are_inside_their_intervals(corrected):
    shop, _ = corrected
    gains, estimate = solution_from_artifact(_model(shop)).gains, estimate_from_artifact(_model(shop))
    assert gains.determined.all()
    assert (np.abs(gains.gain - list(FACTORS.values())) < RECOVERY_SIGMA * gains.deviation).all()
    true = read_truth(shop.runs / "loaded" / "truth.json", shop.runs / "loaded" / "record.h5")
    truth = values_in(load_experiment(shop.folder / "payload.yaml"), "carried", true)
    wanted = np.array([truth[name] for name in estimate.names])
    # Of 32 intervals of 95 %, correlated: more than five that do not hold have a chance below 1 %.
    assert np.sum((estimate.lower > wanted) | (wanted > estimate.upper)) <= 5


def test_a_new_motion_is_predicted_in_the_torques_that_motors_had(corrected):
    shop, _ = corrected
    summary = json.loads((shop.runs / "summary.json").read_text())
    # Left as recorded, its torques would be off by 6 to 15 %.
    assert summary["fits.carried.validation.relative_error"] < 0.02
    assert [summary[f"fits.carried.gain.{name}"] for name in FACTORS] == pytest.approx(
        solution_from_artifact(_model(shop)).gains.gain.tolist()
    )


def test_gains_stand_on_terminal_page_and_in_exports(corrected):
    shop, told = corrected
    gains = solution_from_artifact(_model(shop)).gains
    shown = [f"{name} {gain:.3g}" for name, gain in zip(FACTORS, gains.gain.tolist(), strict=True)]
    files = {"json": "parameters.json", "robot": "robot.yaml", "urdf": "robot.urdf", "mat": "model.mat"}
    folder = shop.runs / "fits" / "carried" / "export"
    for form in files:
        assert shop.robid("export", "payload.yaml", "--format", form).code == 0
    told_in = [told, *((folder / files[form]).read_text() for form in ("robot", "urdf"))]
    told_in.append((shop.runs / "report.html").read_text())
    for text in told_in:
        assert all(one in " ".join(text.replace("\n#", " ").split()) for one in shown)
    found = json.loads((folder / files["json"]).read_text())["gains"]
    assert [found[name]["gain"] for name in FACTORS] == pytest.approx(gains.gain.tolist())
    assert [found[name]["std"] for name in FACTORS] == pytest.approx(gains.deviation.tolist())
    assert loadmat(folder / files["mat"])["gain"].ravel() == pytest.approx(gains.gain)


def test_what_the_robot_file_doubts_is_part_of_what_a_fit_rests_on(corrected):
    shop, _ = corrected
    shop.change("name: carrier", "name: carrier\ndoubts: {payload_relative_std: 0.05}", "carrier_robot.yaml")
    try:
        status, why = shop.states()["fits/carried/model.h5"]
        assert status == "stale"
        assert "robot.doubts.payload_relative_std" in why
    finally:
        shop.change("\ndoubts: {payload_relative_std: 0.05}", "", "carrier_robot.yaml")


def test_gains_without_a_known_payload_are_refused(shop):
    _start(shop)
    shop.change("payload: body, friction: viscous", "payload: body, friction: load", "payload.yaml")
    shop.refuse(2, "fits.carried.gain_std: S480", command=("run", "payload.yaml"))
    shop.change("friction: load", "friction: viscous", "payload.yaml")
    shop.change("payload: {mass_kg: 8,", "payload: {assumed: [mass_kg], mass_kg: 8,", "carrier_robot.yaml")
    shop.refuse(2, "fits.carried.gain_std: S481", command=("run", "payload.yaml"))


def test_friction_in_another_unit_than_the_records_is_not_handed_on(shop):
    _start(shop)
    shop.change("friction: viscous", "friction: coulomb", "payload.yaml")
    handed = [load_experiment(shop.folder / "payload.yaml").experiment.fits["carried"].hands_on]
    shop.change("    gain_std: 0.1\n", "", "payload.yaml")
    handed.append(load_experiment(shop.folder / "payload.yaml").experiment.fits["carried"].hands_on)
    assert handed == [("standard",), ("friction", "standard")]

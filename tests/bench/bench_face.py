"""How long the Python face takes to open a run and read its parameters, against reading the file."""

import h5py
import numpy as np
import pytest

import robid
from exact_systems import exact_frf, two_joint_robot
from robid.artifacts.store import write_artifact
from robid.face.robots import RobotModel
from robid.models.elastic.files import model_of
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.resonances import tabulate_resonances


def read_all(path):
    """Every dataset of a file, as it lies there."""
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


@pytest.mark.quick
def test_parameters_of_a_run_against_reading_their_file(compare, tmp_path):
    robot = two_joint_robot()
    configurations = np.random.default_rng(2).uniform(-1, 1, (8, 2))
    frf = exact_frf(robot, configurations, np.geomspace(3, 80, 60), delay_s=1e-3, relative_noise=0.02)
    fit = robid.fit_model("elastic", RobotModel(robot), frf, delay_s=1e-3)
    table = tabulate_resonances(robot, fit.found.solution, frf, ElasticOptions(), 1e-3)
    path = tmp_path / "fits" / "own" / "model.h5"
    path.parent.mkdir(parents=True)
    write_artifact(path, model_of(fit.found.solution, fit.found.alone, table))
    assert robid.open(tmp_path).fits["own"].parameters["gear_1.stiffness"].value > 0
    compare(
        "face.parameters_vs_read",
        ours=lambda: len(robid.open(tmp_path).fits["own"].parameters),
        reference=lambda: read_all(path),
        rounds=31,
    )

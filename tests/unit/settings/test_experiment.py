from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from robid.design.options import DesignOptions
from robid.fit.options import ElasticOptions, Weights
from robid.settings.experiment import Acquire, Configurations, Design, ElasticFit, Execution
from robid.settings.load import load_experiment
from robid.settings.slices import settings_hash, settings_slice, to_plain
from tolerances import IDENTITY

CONFIGS = Path(__file__).parents[3] / "configs"
LOWER, UPPER = np.array([-1.0, -0.5]), np.array([1.0, 0.8])


def _log(file: str) -> Acquire:
    channel = {"name": "one", "variable": "x"}
    data = {"file": file, "format": "mat", "sampling_period_s": 1, "inputs": [channel], "outputs": [channel]}
    return Acquire.model_validate(data)


def test_fits_and_designs_give_the_plain_options_they_were_written_with():
    data = {"family": "elastic", "from": "a", "starts": 7, "weights": {"kind": "user"}, "free": ["delay"]}
    fit = TypeAdapter(ElasticFit).validate_python(data)
    assert fit.campaign == "a"
    assert fit.options() == ElasticOptions(starts=7, weights=Weights(kind="user"), free=("delay",))
    assert type(fit.options()) is ElasticOptions
    design = TypeAdapter(Design).validate_python({"campaign": "c", "count": 4})
    assert design.options() == DesignOptions(count=4)
    assert type(design.options()) is DesignOptions


def test_configurations_listed_and_on_a_grid():
    listed = Configurations.model_validate({"list_deg": [[0, 90], [45, -90]]}).angles_rad(LOWER, UPPER)
    np.testing.assert_allclose(listed, [[0, np.pi / 2], [np.pi / 4, -np.pi / 2]], rtol=IDENTITY)
    grid = Configurations.model_validate({"grid_deg": [[0, 10], [20, 30, 40]]}).angles_rad(LOWER, UPPER)
    assert grid.shape == (6, 2)
    assert {tuple(row) for row in np.round(np.rad2deg(grid)).astype(int)} == {
        (a, b) for a in (0, 10) for b in (20, 30, 40)
    }
    assert Configurations.model_validate({"from": "best"}).angles_rad(LOWER, UPPER) is None


def test_random_configurations_keep_their_margin_and_repeat_with_their_seed():
    settings = Configurations.model_validate({"random": {"count": 500, "seed": 3, "margin_deg": 5}})
    drawn, margin = settings.angles_rad(LOWER, UPPER), np.deg2rad(5)
    assert drawn.shape == (500, 2)
    assert ((drawn >= LOWER + margin) & (drawn <= UPPER - margin)).all()
    np.testing.assert_allclose(drawn.min(axis=0), LOWER + margin, atol=0.03)
    np.testing.assert_allclose(drawn.max(axis=0), UPPER - margin, atol=0.03)
    np.testing.assert_array_equal(drawn, settings.angles_rad(LOWER, UPPER))


def test_the_data_folder_is_looked_up_when_asked_for(monkeypatch):
    log = _log("${ROBID_DATA}/bench/log.mat")
    monkeypatch.delenv("ROBID_DATA", raising=False)
    assert log.log_path(Path("configs")) == Path("../shared/data/bench/log.mat")
    monkeypatch.setenv("ROBID_DATA", "elsewhere")
    assert log.log_path(Path("configs")) == Path("elsewhere/bench/log.mat")
    assert _log("logs/log.mat").log_path(Path("configs")) == Path("configs/logs/log.mat")


def test_execution_defaults_to_all_cores():
    assert Execution().workers is None


def test_slices_hold_what_was_asked_for_under_the_files_names():
    loaded = load_experiment(CONFIGS / "kr300.yaml")
    part = settings_slice(loaded, "campaigns.estimation.configurations", "robot.controller", "fits.elastic")
    assert list(part) == ["campaigns.estimation.configurations", "robot.controller", "fits.elastic"]
    assert part["campaigns.estimation.configurations"]["from"] == "optimal"
    assert part["robot.controller"]["delay_samples"] == 1
    assert part["fits.elastic"]["from"] == "estimation"
    with pytest.raises(KeyError):
        settings_slice(loaded, "campaigns.nowhere")


def test_hash_depends_on_content_and_not_on_order_or_number_form():
    loaded = load_experiment(CONFIGS / "kr300.yaml")
    excitation = loaded.experiment.campaigns["estimation"].excitation
    plain = to_plain(excitation)
    assert settings_hash(excitation) == settings_hash(dict(reversed(plain.items())))
    assert settings_hash(excitation) != settings_hash({**plain, "seed": plain["seed"] + 1})
    # `period_s: 5` and `period_s: 5.0` are the same setting.
    assert plain["period_s"] == 5
    assert type(plain["period_s"]) is type(plain["low_hz"]) is float
    assert settings_hash({}) == "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a"

from pathlib import Path

from pydantic import TypeAdapter

from robid.artifacts.artifact import canonical_hash
from robid.design.configurations.options import DesignOptions
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.settings import ElasticFit
from robid.models.known import load_experiment
from robid.settings.experiment import Configurations, Design, Execution
from robid.settings.robot_parts import plain_settings
from robid.settings.sources import Acquire

CONFIGS = Path(__file__).parents[3] / "configs"


def _log(file: str) -> Acquire:
    channel = {"name": "one", "variable": "x"}
    data = {"file": file, "format": "mat", "sampling_period_s": 1, "inputs": [channel], "outputs": [channel]}
    return TypeAdapter(Acquire).validate_python(data)


def test_fits_and_designs_give_the_plain_options_they_were_written_with():
    data = {"family": "elastic", "from": "a", "starts": 7, "weights": {"kind": "user"}, "free": ["delay"]}
    fit = TypeAdapter(ElasticFit).validate_python(data)
    assert fit.campaign == "a"
    assert fit.options() == ElasticOptions(starts=7, weights=Weights(kind="user"), free=("delay",))
    assert type(fit.options()) is ElasticOptions
    design = TypeAdapter(Design).validate_python({"campaign": "c", "count": 4})
    assert design.options() == DesignOptions(count=4)
    assert type(design.options()) is DesignOptions


def test_configurations_name_the_designs_that_they_wait_for():
    sections = {"join": [{"from": ["b", "a"]}, {"list_deg": [[0, 1]]}, {"mirror": "c"}, {"join": [{"from": "a"}]}]}
    assert Configurations.model_validate(sections).designs == ("b", "a", "c")
    assert Configurations.model_validate({"from": "a"}).designs == ("a",)
    assert Configurations.model_validate({"list_deg": [[0, 1]]}).designs == ()


def test_the_data_folder_is_looked_up_when_asked_for(monkeypatch):
    log = _log("${ROBID_DATA}/bench/log.mat")
    monkeypatch.delenv("ROBID_DATA", raising=False)
    assert log.log_path(Path("configs")) == Path("../shared/data/bench/log.mat")
    monkeypatch.setenv("ROBID_DATA", "elsewhere")
    assert log.log_path(Path("configs")) == Path("elsewhere/bench/log.mat")
    assert _log("logs/log.mat").log_path(Path("configs")) == Path("configs/logs/log.mat")


def test_execution_defaults_to_all_cores():
    assert Execution().workers is None


def test_hash_depends_on_content_and_not_on_order_or_number_form():
    loaded = load_experiment(CONFIGS / "kr300.yaml")
    excitation = loaded.experiment.campaigns["estimation"].excitation
    plain = plain_settings(excitation)
    assert canonical_hash(plain) == canonical_hash(dict(reversed(plain.items())))
    assert canonical_hash(plain) != canonical_hash({**plain, "seed": plain["seed"] + 1})
    # `period_s: 5` and `period_s: 5.0` are the same setting.
    assert plain["period_s"] == 5
    assert type(plain["period_s"]) is type(plain["low_hz"]) is float
    assert canonical_hash({}) == "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a"

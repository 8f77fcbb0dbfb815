"""What a rigid fit hands on: its friction to responses, its masses to elastic fits."""

import re
import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

from exact_systems import certain
from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL, estimate_from_artifact
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fitting import nominal_robot
from robid.models.handed_on import friction_from_artifact, standard_from_artifact
from robid.models.known import load_experiment
from robid.pipeline.fit import read_data
from robid.pipeline.plans import data_inputs

HERE = Path(__file__).parent
FRICTION = "friction: {coulomb_nm: 0.5, static_nm: 0.6, presliding_rad: 0.02, viscous_nms_rad: "
EXPERIMENT = """\
schema_version: 1
name: payload
robot: carrier_robot.yaml
campaigns:
  motion:
    configurations: {list_deg: [[0, 20, -40]]}
    excitation: {signal: fourier, period_s: 5, low_hz: 0.2, high_hz: 2, count: 5, detection_share: 0, rms: 80,
      max_excursion_deg: 90, seed: 1}
    periods: 1
    source: &source
      simulate:
        transient_periods: 1
        imperfections: {encoder_noise_rad: 1.0e-4, torque_noise_nm: 0.05, friction: lugre}
        truth: {friction_relative: 0.5, seed: 3}
        seed: 1
  shaken:
    configurations: {list_deg: [[0, 20, -40]]}
    excitation: {period_s: 1, low_hz: 2, high_hz: 40, count: 12, rms: 6, seed: 1, phase_iterations: 0}
    periods: 2
    source: *source
    estimate: {compensation: {fit: rigid}}
fits:
  rigid: {family: rigid, from: motion, model: {friction: coulomb}, filters: {position_cut_hz: 20}, instruments: none}
execution: {backend: serial, workers: 1}
"""


@pytest.fixture
def shaken(shop):
    return prepared(shop)


def prepared(shop):
    text = (HERE / "carrier_robot.yaml").read_text().replace("friction: {viscous_nms_rad: ", FRICTION)
    (shop.folder / "carrier_robot.yaml").write_text(text)
    (shop.folder / "small.yaml").write_text(EXPERIMENT)
    shop.runs = shop.folder / "runs" / "payload"
    return shop


@pytest.fixture(scope="module")
def freed_run(tmp_path_factory, workshop):
    with pytest.MonkeyPatch.context() as patch:
        shop = prepared(workshop(tmp_path_factory.mktemp("freed"), patch))
        # Bristles are not what the rigid fit knows: its grade is not the point.
        assert shop.robid("run", "small.yaml").code in (0, 5)
        answer = shop.robid("estimate-frf", "small.yaml", "--campaign", "shaken")
        assert answer.code == 0, answer.err
    return shop.folder / "runs"


@pytest.fixture
def freed(shaken, freed_run):
    """A folder with the finished run."""
    shutil.copytree(freed_run, shaken.folder / "runs")
    return shaken


def read_laws(shop):
    frf = frf_from_artifact(read_artifact(shop.runs / "shaken" / "frf.h5", FRF))
    return dict(zip(frf.law_names, zip(frf.law_values, frf.law_std, strict=True), strict=True)), frf


def test_a_response_is_freed_from_the_friction_that_a_rigid_fit_found(freed):
    estimate = estimate_from_artifact(read_artifact(freed.runs / "fits" / "rigid" / "model.h5", MODEL))
    std = dict(zip(estimate.names, np.sqrt(np.diag(estimate.covariance)), strict=True))
    laws, frf = read_laws(freed)
    true = read_truth(freed.runs / "shaken" / "truth.json", freed.runs / "shaken" / "record.h5").robot
    for joint in true.joints:
        level = laws[f"{joint.name}.coulomb_nm"]
        assert level == pytest.approx((estimate.found[f"{joint.name}.coulomb"], std[f"{joint.name}.coulomb"]))
        # The fit knows a jump where the robot has bristles.
        assert level[0] == pytest.approx(joint.motor.friction.coulomb_nm, rel=0.1)
        index = frf.coefficient_names.index(f"{joint.name}.level")
        assert frf.coefficient_offset[index] == pytest.approx(level[0] / 0.5 - 1)
        assert frf.coefficient_relative_std[index] == pytest.approx(level[1] / 0.5)
    assert frf.compensation == "fit"
    assert any("that of fit rigid" in note for note in frf.notes)


def test_the_graph_knows_the_fit(freed):
    assert freed.states()["shaken/frf.h5"][0] == "fresh"
    freed.change("position_cut_hz: 20", "position_cut_hz: 25")
    status, why = freed.states()["shaken/frf.h5"]
    assert status == "stale"
    assert "fits/rigid/model.h5" in why


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("{fit: rigid}", "{fit: rigit}", "there is no fit `rigit`; did you mean `rigid`?"),
        ("friction: coulomb", "friction: viscous", "fit `rigid` of family `rigid` hands on no Coulomb friction"),
        (
            "fits:\n",
            "fits:\n  soft: {family: elastic, from: shaken}\n",
            "fit `soft` of family `elastic` hands on no Coulomb friction",
        ),
    ],
)
def test_a_fit_that_has_no_friction_is_refused_with_its_place(shaken, old, new, told):
    if "soft" in new:
        shaken.change("{fit: rigid}", "{fit: soft}")
    shaken.change(old, new)
    answer = shaken.refuse(2, "campaigns.shaken.estimate.compensation.fit: ", told)
    line = next(number for number, text in enumerate(read(shaken), start=1) if "compensation:" in text)
    assert f"small.yaml:{line}:" in answer.flat


def read(shop):
    return (shop.folder / "small.yaml").read_text().splitlines()


def test_another_word_is_refused_with_those_that_there_are(shaken):
    shaken.change("{fit: rigid}", "silence")
    assert "'silent_lines'" in shaken.refuse(2, "campaigns.shaken.estimate.compensation").flat
    shaken.change("silence", "{fits: rigid}")
    shaken.refuse(2, "campaigns.shaken.estimate.compensation.fits: S380 unknown key; did you mean `fit`?")


def test_friction_and_configurations_that_wait_for_each_other_are_refused(shaken):
    shaken.change(
        "motion:\n    configurations: {list_deg: [[0, 20, -40]]}", "motion:\n    configurations: {from: best}"
    )
    design = "designs:\n  best: {campaign: shaken, count: 1, information: measured}\nfits:\n"
    shaken.change("fits:\n", design)
    shaken.refuse(2, "go in a circle: motion -> motion")


def test_currents_and_torques_do_not_mix():
    artifact = Artifact(MODEL, {}, {"rigid/torque_unit": "A"}, Provenance(stage="fit"))
    with pytest.raises(DataError, match="knows friction in A, but it is subtracted from torques in N m"):
        friction_from_artifact(artifact, "rigid", ("waist",))


@pytest.fixture(scope="module")
def fed_run(tmp_path_factory, workshop):
    """A rigid fit, an elastic one with its masses, and one with the robot file's."""
    with pytest.MonkeyPatch.context() as patch:
        shop = workshop(tmp_path_factory.mktemp("fed"), patch)
        shutil.copy(HERE / "feed.yaml", shop.folder / "small.yaml")
        assert shop.robid("run", "small.yaml").code in (0, 5)  # the elastic fit with wrong masses is not to be used
    return shop.folder / "runs"


@pytest.fixture
def fed(shop, fed_run):
    shutil.copy(HERE / "feed.yaml", shop.folder / "small.yaml")
    shutil.copytree(fed_run, shop.folder / "runs")
    shop.runs = shop.folder / "runs" / "feed"
    return shop


def fitted(shop, name):
    return estimate_from_artifact(read_artifact(shop.runs / "fits" / name / "model.h5", MODEL))


def test_an_elastic_fit_with_the_masses_of_a_rigid_one_finds_the_springs(fed):
    true = read_truth(fed.runs / "estimation" / "truth.json", fed.runs / "estimation" / "record.h5").robot
    plain, own = fitted(fed, "plain"), fitted(fed, "fed")
    for spring in true.springs:
        name = f"{spring.name}.stiffness"
        index = own.names.index(name)
        assert own.lower[index] <= spring.stiffness <= own.upper[index]
        assert abs(own.value[index] / spring.stiffness - 1) < 0.01
        assert abs(plain.found[name] / spring.stiffness - 1) > 0.05
    assert "what the rigid fit leaves open" in own.interval_rule
    assert "rigid" not in plain.interval_rule


def test_what_the_rigid_fit_leaves_open_is_in_the_intervals(fed):
    """With a file that is taken for granted the same fit would be surer of every spring."""
    loaded = load_experiment(fed.folder / "small.yaml")
    inputs = {key: fed.runs / path for key, path in data_inputs(("frf",), ("estimation",)).items()}
    data = read_data(loaded, "fed", {**inputs, "standard": fed.runs / "fits" / "rigid" / "model.h5"})
    options = loaded.experiment.fits["fed"].options()
    sure = fit_elastic(certain(nominal_robot(data)), data.response, options, 1e-3).estimate
    own = fitted(fed, "fed")
    assert sure.names == own.names
    np.testing.assert_allclose(sure.value, own.value, rtol=1e-6)
    grown = np.sqrt(np.diag(own.covariance) / np.diag(sure.covariance))
    assert grown.min() > 1 - 1e-9
    assert grown[own.names.index("gear_lift.stiffness")] > 1.2


def test_an_export_has_the_rigid_fits_masses(fed):
    answer = fed.robid("export", "small.yaml", "--fit", "fed", "--format", "mjcf")
    assert answer.code == 0, answer.err
    model = mujoco.MjModel.from_xml_path(str(fed.runs / "fits" / "fed" / "export" / "model.xml"))
    rigid = read_artifact(fed.runs / "fits" / "rigid" / "model.h5", MODEL)
    standard = standard_from_artifact(rigid, "rigid").values
    assert model.body("turn").mass[0] == pytest.approx(standard["turn.M"])
    # The payload is part of the rigid fit's last link.
    assert model.body("lift").mass[0] == pytest.approx(standard["lift.M"])


def test_the_page_shows_modes_of_the_arm_with_the_rigid_fits_masses(fed):
    content = (fed.runs / "report.html").read_text()
    found = {name: set(re.findall(rf'"anchor":"({name}-mode-\d+-\d+)"', content)) for name in ("fed", "plain")}
    assert found["fed"]
    assert found["plain"]


def test_the_graph_knows_whose_masses_they_are(fed):
    assert {status for status, _ in fed.states().values()} == {"fresh"}
    fed.change("position_cut_hz: 15", "position_cut_hz: 14")
    states = fed.states()
    for output in ("fits/fed/model.h5", "fits/fed/validation.h5"):
        assert states[output][0] == "stale"
    assert "fits/rigid/model.h5" in states["fits/fed/model.h5"][1]
    assert states["fits/plain/model.h5"][0] == "fresh"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("rigit", "there is no fit `rigit`; did you mean `rigid`?"),
        ("plain", "fit `plain` of family `elastic` hands on no masses and inertias: name one of family `rigid`"),
        ("fed", "fit `fed` of family `elastic` hands on no masses"),
    ],
)
def test_masses_of_another_fit_are_refused_with_their_place(fed, name, told):
    fed.change("rigid: rigid", f"rigid: {name}")
    assert "small.yaml:" in fed.refuse(2, "fits.fed.rigid: ", told).flat


def test_a_fit_without_real_bodies_says_so(fed):
    fed.change("model: {friction: viscous}", "model: {friction: viscous}, physical: false")
    fed.refuse(2, "hands on no masses and inertias", "physical: true")


def test_a_standard_set_that_is_not_there_is_refused():
    with pytest.raises(DataError, match="D162"):
        standard_from_artifact(Artifact(MODEL, {}, {}, Provenance(stage="fit")), "rigid")
    unit = {"rigid/torque_unit": "A", "rigid/standard/status": "estimated"}
    with pytest.raises(DataError, match="D161"):
        standard_from_artifact(Artifact(MODEL, {}, unit, Provenance(stage="fit")), "rigid")

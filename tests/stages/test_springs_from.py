"""An elastic fit takes the gears that a fit with encoders on both sides has found as known beforehand."""

import shutil

import numpy as np
import pytest

import robid
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL, estimate_from_artifact
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth

FITS = """\
  gears: {family: transmission, from: estimation, cut_hz: 60}
  plain: {family: elastic, from: estimation, starts: 1}
  fed: {family: elastic, from: estimation, validate_on: validation, starts: 1, springs_from: gears}
  fixed: {family: elastic, from: estimation, starts: 1, springs_from: gears, fixed: [gear_lift.stiffness]}
"""


def prepared(shop):
    shop.change("  elastic: {family: elastic, from: estimation, validate_on: validation, starts: 2}\n", FITS)
    shop.change("nominal}\n  validation:", "nominal}\n    outputs: [motors, turn.arm, lift.arm]\n  validation:")
    shop.change("nominal}\ndesigns:", "nominal}\n    outputs: [motors, turn.arm, lift.arm]\ndesigns:")
    return shop


@pytest.fixture(scope="module")
def fed_run(tmp_path_factory, workshop):
    with pytest.MonkeyPatch.context() as patch:
        shop = prepared(workshop(tmp_path_factory.mktemp("springs"), patch))
        answer = shop.robid("run", "small.yaml")
        # No links lie in line in this robot: a spring that is fixed is too soft by what the file allows for.
        assert answer.code == 5, answer.err
    return shop.folder / "runs"


@pytest.fixture
def fed(shop, fed_run):
    shutil.copytree(fed_run, shop.folder / "runs")
    return prepared(shop)


def fitted(shop, name):
    return estimate_from_artifact(read_artifact(shop.runs / "fits" / name / "model.h5", MODEL))


def test_springs_start_from_the_gears_and_are_known_as_well_as_these(fed):
    gears, own, plain = (fitted(fed, name) for name in ("gears", "fed", "plain"))
    factor = 1 - np.sqrt(2 / np.pi) * 0.12
    for name in ("gear_turn.stiffness", "gear_lift.stiffness"):
        row, of = own.names.index(name), gears.names.index(name)
        middle = np.sqrt(gears.lower[of] * gears.upper[of])
        gear_std = np.log(gears.upper[of] / gears.lower[of]) / 2 / 1.959964
        share_std = np.sqrt(1 - 2 / np.pi) * 0.12 / factor
        assert own.nominal[row] == pytest.approx(factor * middle)
        assert own.prior_relative_std[row] == pytest.approx(np.hypot(gear_std, share_std), rel=1e-6)
        assert plain.prior_relative_std[plain.names.index(name)] > 2
    true = read_truth(fed.runs / "estimation" / "truth.json", fed.runs / "estimation" / "record.h5").robot
    for spring in true.springs:
        row = own.names.index(f"{spring.name}.stiffness")
        assert own.lower[row] <= spring.stiffness <= own.upper[row]


def test_a_fixed_spring_is_that_of_the_gears_in_an_export(fed):
    answer = fed.robid("export", "small.yaml", "--fit", "fixed", "--format", "mjcf")
    assert answer.code == 0, answer.err
    assert "gear_lift.stiffness" not in fitted(fed, "fixed").names
    gears = fitted(fed, "gears")
    of = gears.names.index("gear_lift.stiffness")
    wanted = (1 - np.sqrt(2 / np.pi) * 0.12) * np.sqrt(gears.lower[of] * gears.upper[of])
    written = (fed.runs / "fits" / "fixed" / "export" / "model.xml").read_text()
    springs = [float(part.split('"')[0].split()[0]) for part in written.split('stiffness="')[1:]]
    assert any(each == pytest.approx(wanted, rel=1e-4) for each in springs)


def test_the_graph_knows_whose_gears_they_are(fed):
    assert {status for status, _ in fed.states().values()} == {"fresh"}
    fed.change("cut_hz: 60", "cut_hz: 50")
    states = fed.states()
    for output in ("fits/fed/model.h5", "fits/fed/validation.h5", "fits/fixed/model.h5"):
        assert states[output][0] == "stale"
    assert "fits/gears/model.h5" in states["fits/fed/model.h5"][1]
    assert states["fits/plain/model.h5"][0] == "fresh"


def test_the_page_says_which_springs_were_known_and_from_where(fed):
    content = (fed.runs / "report.html").read_text()
    assert content.count("found these gears from encoders on both of their sides") == 2
    assert "Gear by gears" in content


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("gaers", "there is no fit `gaers`; did you mean `gears`?"),
        ("plain", "fit `plain` of family `elastic` hands on no springs of gears: name one of family `transmission`"),
        ("fed", "fit `fed` of family `elastic` hands on no springs of gears"),
    ],
)
def test_gears_of_another_fit_are_refused_with_their_place(fed, name, told):
    fed.change("starts: 1, springs_from: gears}", f"starts: 1, springs_from: {name}}}")
    assert "small.yaml:" in fed.refuse(2, "fits.fed.springs_from: ", told).flat


def test_gears_that_are_not_identified_are_refused(fed):
    fed.change("cut_hz: 60", "cut_hz: 60, identifiable_relative_std: 1.0e-5")
    answer = fed.robid("run", "small.yaml")
    assert answer.code == 4
    assert "D651 fit `gears` identified the stiffness of no gear of two-joint arm" in answer.flat


def test_the_same_in_memory(fed):
    robot = robid.load_robot(fed.folder / "arm.yaml")
    record = record_from_artifact(read_artifact(fed.runs / "estimation" / "record.h5", RECORD))
    responses = frf_from_artifact(read_artifact(fed.runs / "estimation" / "frf.h5", FRF))
    gears = robid.fit_model("transmission", robot, record, cut_hz=60.0)
    found = robid.fit_model("elastic", robot, responses, starts=1, springs_from=gears)
    stored = fitted(fed, "fed")
    assert tuple(found.parameters) == stored.names
    np.testing.assert_allclose([one.value for one in found.parameters.values()], stored.value, rtol=1e-6)


HYSTERESIS = """\
  gears: {family: transmission, from: estimation, cut_hz: 60}
  fed: {family: elastic, from: estimation, starts: 1, springs_from: gears}
  freed:
    family: elastic
    from: estimation
    starts: 1
    springs_from: gears
    free: [stiffness, damping, viscous, motor_inertia, hysteresis]
"""
SLIP_NM = 2.0


def test_the_torque_at_which_hysteresis_slips_is_known_too(shop):
    prepared(shop)
    shop.change(FITS, HYSTERESIS)
    shop.change("friction: lugre}", f"friction: lugre, hysteresis_nm: {SLIP_NM}}}")
    answer = shop.robid("run", "small.yaml")
    assert answer.code in {0, 5}, answer.err
    true = read_truth(shop.runs / "estimation" / "truth.json", shop.runs / "estimation" / "record.h5").robot
    gears, fed, freed = (fitted(shop, name) for name in ("gears", "fed", "freed"))
    for joint, spring in (("turn", true.springs[0]), ("lift", true.springs[1])):
        slip, of = freed.names.index(f"gear_{joint}.hysteresis"), gears.names.index(f"{joint}.slip")
        assert freed.nominal[slip] == pytest.approx(0.5 * (gears.lower[of] + gears.upper[of]))
        assert freed.value[slip] == pytest.approx(SLIP_NM, rel=0.25)
        # Bristles that are left out stiffen what a fit finds.
        without, with_it = (
            each.value[each.names.index(f"{spring.name}.stiffness")] / spring.stiffness - 1 for each in (fed, freed)
        )
        assert abs(with_it) < 0.01 < without
    page = (shop.runs / "report.html").read_text()
    assert "name `hysteresis` in `free`" in page.replace("<code>", "`").replace("</code>", "`")


@pytest.mark.parametrize(
    ("text", "place", "code"),
    [
        ("rated_torque_nm: {lifted: 300}", "rated_torque_nm.lifted", "S650"),
        ("rated_torque_nm: {lift: 0}", "rated_torque_nm.lift", "S651"),
        ("gear: {motor_orders: [1, 0]}", "gear.motor_orders", "S652"),
        ("stiffness_torques_nm: {lifted: [3]}", "stiffness_torques_nm.lifted", "S650"),
        ("stiffness_torques_nm: {lift: [30, 20]}", "stiffness_torques_nm.lift", "S658"),
        ("stiffness_torques_nm: {lift: [0, 20]}", "stiffness_torques_nm.lift", "S658"),
    ],
)
def test_a_gear_that_is_stated_wrongly_is_refused_with_its_place(shop, text, place, code):
    prepared(shop).change("cut_hz: 60", f"cut_hz: 60, {text}")
    shop.refuse(2, f"fits.gears.{place}: {code}")

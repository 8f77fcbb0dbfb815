"""Bad input through the command line: one message with place and remedy, the exit code, all artifacts untouched."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from robid.artifacts.kinds import DESIGN, FRF, design_from_artifact, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.design.configurations.candidates import candidate_information
from robid.models.known import load_experiment
from tolerances import IDENTITY
from two_mass_log import LINES, LOAD, MOTOR, PERIOD_S, STEP_S, STIFFNESS, bench_log


def refuse(shop, code, *texts, command=("run", "small.yaml")):
    """Runs a command that must fail, with one message and nothing changed."""
    return shop.refuse(code, *texts, command=command)


@pytest.mark.parametrize(
    ("old", "new", "texts"),
    [
        ("periods: 2", "perods: 2", ("small.yaml:12", "campaigns.estimation.perods", "did you mean `periods`?")),
        ("count: 2}", "count: many}", ("designs.best.count", "found 'many'")),
        ("[[20, 30]]", "[[20, 130]]", ("list_deg[1][2]", "130 deg is unreachable", "from -60 to 100 deg")),
        ("high_hz: 80", "high_hz: 600", ("campaigns.candidates.excitation", "Nyquist frequency 500 Hz")),
        ("from: estimation", "from: estimatoin", ("fits.elastic.from", "did you mean `estimation`?")),
        ("validate_on: validation", "validate_on: estimation", ("fits.elastic.validate_on", "S198")),
        ("robot: arm.yaml", "robot: leg.yaml", ("small.yaml:3", "leg.yaml")),
    ],
)
def test_settings_are_refused_with_their_place(done, old, new, texts):
    done.change(old, new)
    refuse(done, 2, *texts)


def test_every_problem_is_told_at_once(done):
    done.change("periods: 2", "perods: 2")
    done.change("[[20, 30]]", "[[20]]")
    done.change("name: turn", "name: torn", "arm.yaml")
    refuse(done, 2, "perods", "there is no joint `turn`")


def test_an_excitation_over_a_limit_names_motor_and_admissible_rms(done):
    done.change("rms: 6", "rms: 200")
    refuse(done, 2, "small.yaml: campaigns.estimation.excitation.rms", "motor lift", "admissible rms", "rad/s")


def test_a_missing_artifact_names_the_command(done):
    (done.runs / "estimation" / "record.h5").unlink()
    command = ("estimate-frf", "small.yaml", "--campaign", "estimation")
    texts = ("estimation/record.h5", "`robid simulate-or-acquire small.yaml --campaign estimation` makes it")
    refuse(done, 3, *texts, command=command)
    refuse(done, 3, "nothing.h5", command=("inspect", "nothing.h5"))


@pytest.mark.parametrize("command", [("run", "small.yaml"), ("fit", "small.yaml", "--force")])
def test_a_damaged_artifact_is_refused_by_name(done, command):
    path = done.runs / "estimation" / "frf.h5"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refuse(done, 3, "estimation/frf.h5", "is damaged", "estimate-frf", command=command)


@pytest.mark.parametrize("elsewhere", [(), ("--run-dir", "elsewhere")])
def test_the_remedy_of_a_damaged_artifact_makes_it_again(done, elsewhere):
    folder = done.runs
    if elsewhere:
        folder = done.folder / "elsewhere"
        done.runs.rename(folder)
    path = folder / "estimation" / "frf.h5"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    answer = refuse(done, 3, "delete it and make it again with", command=("fit", "small.yaml", "--force", *elsewhere))
    command = re.search("`robid ([^`]*)`", answer.flat)[1].split()
    assert command == ["estimate-frf", "small.yaml", "--campaign", "estimation", *elsewhere]
    path.unlink()
    assert done.robid(*command).code == 0
    assert read_artifact(path, FRF).datasets


def test_a_flipped_number_is_refused_by_name(done):
    path = done.runs / "estimation" / "frf.h5"
    with h5py.File(path, "r+") as file:
        file["frequency_hz"][3] *= 1.001
    texts = ("estimation/frf.h5", "does not match its hash")
    refuse(done, 3, *texts, command=("fit", "small.yaml", "--force"))


@pytest.mark.parametrize("command", [("run", "small.yaml"), ("fit", "small.yaml", "--force")])
def test_an_artifact_of_a_future_version_is_refused_and_kept(done, command):
    path = done.runs / "estimation" / "frf.h5"
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = np.bytes_("99.0")
    refuse(done, 3, "estimation/frf.h5", "schema version 99.0", "use the robid that wrote it", command=command)


def test_a_file_that_is_no_artifact_is_not_overwritten(shop):
    target = shop.runs / "estimation" / "record.h5"
    target.parent.mkdir(parents=True)
    target.write_text("my notes")
    refuse(shop, 3, "estimation/record.h5")
    assert target.read_text() == "my notes"


def test_a_simulation_that_blows_up_names_its_configuration(done):
    done.change("rms: 6", "rms: 0.01")
    done.change("speed_bandwidth_hz: 20", "speed_bandwidth_hz: 2000", "arm.yaml")
    done.change("max_torque_nm: 30", "max_torque_nm: 1.0e+12", "arm.yaml")
    done.change("max_torque_nm: 30", "max_torque_nm: 1.0e+12", "arm.yaml")
    before = {path: digest for path, digest in done.files().items() if "excitation" not in path}
    answer = done.robid("run", "small.yaml")
    assert answer.code == 4, answer.err
    for text in ("small.yaml: campaigns.estimation: configuration 1", "blew up in", "lower the speed loop"):
        assert text in answer.flat
    after = done.files()
    assert {path: after[path] for path in before if "designs" not in path} == {
        path: digest for path, digest in before.items() if "designs" not in path
    }
    assert not list(Path.cwd().rglob("MUJOCO_LOG.TXT"))


def spoil_response(done, **changes):
    """Rewrites the estimation's response as another estimate would have written it."""
    path = done.runs / "estimation" / "frf.h5"
    artifact = read_artifact(path, FRF)
    frf = frf_from_artifact(artifact)
    made = {name: change(getattr(frf, name)) for name, change in changes.items()}
    write_artifact(path, frf_to_artifact(replace(frf, **made), artifact.provenance))


def at_one_line(value):
    def change(array):
        changed = array.copy()
        changed[0, 3] = value
        return changed

    return change


def without(_array):
    return None


@pytest.mark.parametrize(
    ("changes", "fit", "texts"),
    [
        ({"response": at_one_line(np.nan)}, "starts: 2", ("the response is not finite at", "estimate it again")),
        ({"total_covariance": at_one_line(np.inf)}, "starts: 2", ("the covariance is not finite at",)),
        ({"total_covariance": at_one_line(0)}, "weights: {kind: optimal}", ("D243", "`user`")),
        (
            {"total_covariance": without},
            "weights: {kind: optimal}",
            ("D244", "two or more"),
        ),
        (
            {"total_covariance": without, "noise_covariance": without},
            "weights: {kind: optimal_full}",
            ("D242", "realizations"),
        ),
        ({"realization_error": without}, "bootstrap: 10", ("D245", "set `bootstrap` to 0")),
        ({}, "weights: {low_cut_hz: 200}", ("D130", "low_cut_hz")),
        ({"response": at_one_line(np.nan)}, "weights: {kind: optimal}, bootstrap: 5", ("not finite",)),
        (
            {},
            "bounds: {gear_lift.stiffness: [1.0e+5, 2.0e+5]}",
            ("gear_lift.stiffness", "at a bound", "widen `bounds`"),
        ),
    ],
)
def test_what_a_fit_cannot_use_is_told_before_it_starts(done, changes, fit, texts):
    spoil_response(done, **changes)
    done.change("starts: 2", fit)
    code = 2 if "bounds" in fit else 4
    refuse(done, code, *texts, command=("fit", "small.yaml", "--force"))


def test_a_parameter_that_changes_nothing_is_told_before_the_fit(done):
    spoil_response(done, frequency_hz=lambda frequency: 1e-7 * frequency)
    refuse(done, 4, "D131", "`fixed`", command=("fit", "small.yaml", "--force"))


@pytest.fixture
def bench(shop):
    here = Path(__file__).parent
    for name in ("bench.yaml", "bench_robot.yaml"):
        shutil.copy(here / name, shop.folder)
    shop.runs, shop.experiment = shop.folder / "runs" / "bench", "bench.yaml"
    savemat(shop.folder / "log.mat", bench_log())
    return shop


def test_a_log_goes_through_the_same_chain(bench):
    answer = bench.robid("run", "bench.yaml", "--json")
    assert answer.code == 0, answer.err
    rows = {(row["name"], row["kind"]): row for row in answer.json["parameters"]["two_mass"]}
    for key, truth in {
        ("coupling", "stiffness"): STIFFNESS,
        ("drive", "motor_inertia"): MOTOR,
        ("drive", "link_inertia"): LOAD,
    }.items():
        assert rows[key]["estimate"] == pytest.approx(truth, rel=0.01)
        assert rows[key]["truth"] is None
    assert rows["coupling", "stiffness"]["unit"] == "A/rad"
    notes = bench.robid("inspect", str(bench.runs / "log" / "frf.h5"), "--json").json
    assert "total_covariance" not in notes["datasets"]
    assert not (bench.runs / "log" / "truth.json").exists()
    assert "fits/two_mass/validation.h5" not in bench.contents()
    (bench.folder / "log.mat").unlink()
    assert set(bench.states().values()) == {("fresh", "")}


def test_a_design_for_a_log_takes_the_lines_and_the_sampling_of_the_log(bench):
    bench.change("fits:\n", "designs:\n  again: {campaign: log, count: 1}\nfits:\n", "bench.yaml")
    answer = bench.robid("design-configs", "bench.yaml")
    assert answer.code == 0, answer.err
    design = design_from_artifact(read_artifact(bench.runs / "designs/again.h5", DESIGN))
    robot = load_experiment(bench.folder / "bench.yaml").robot.to_robot()
    weights, along = np.ones((LINES.size, 1, 1)), ("viscous", "motor_inertia", "delay")
    place = np.zeros((1, 1)), LINES / PERIOD_S, STEP_S, 0.0, 0.03
    wanted, _ = candidate_information(robot, *place, nuisance=along, weights=weights)
    np.testing.assert_allclose(design.information, wanted, rtol=IDENTITY)
    bench.change("sampling_period_s: 1.0e-3", "sampling_period_s: 5.0e-4", "bench.yaml")
    assert bench.states()["designs/again.h5"][0] == "stale"


def test_a_robot_with_logs_alone_needs_no_limits(bench):
    bench.change(", max_speed_rad_s: 300, max_torque_nm: 10", "", "bench_robot.yaml")
    answer = bench.robid("run", "bench.yaml", "--json")
    assert answer.code == 0, answer.err
    rows = {(row["name"], row["kind"]): row["estimate"] for row in answer.json["parameters"]["two_mass"]}
    assert rows["coupling", "stiffness"] == pytest.approx(STIFFNESS, rel=0.01)


def test_whoever_needs_a_limit_names_it(shop):
    for _ in range(2):
        shop.change("      max_speed_rad_s: 400\n", "", "arm.yaml")
    shop.change("count: 2}", "count: 2, cost: travel}")
    texts = (
        "campaigns.estimation.source: S144 a simulation needs the robot file's `motor.max_speed_rad_s` of turn, lift",
        "designs.best.cost: S",
    )
    refuse(shop, 2, *texts)


def test_another_log_makes_the_record_stale(bench):
    assert bench.robid("run", "bench.yaml").code == 0
    log = bench_log()
    log["motor"][7] += 1e-6
    savemat(bench.folder / "log.mat", log)
    assert bench.states()["log/record.h5"] == ("stale", "input log changed")


def cut(log, name, index):
    log[name] = np.delete(log[name], index, axis=0)


@pytest.mark.parametrize(
    ("spoil", "texts"),
    [
        (lambda log: log.update(curent=log.pop("current")), ("`current`", "Did you mean `curent`?")),
        (lambda log: log["motor"].__setitem__(1234, np.nan), ("`motor`", "NaN", "sample 1234")),
        (lambda log: [cut(log, name, slice(900, 950)) for name in list(log)], ("gap", "sample 899")),
        (lambda log: log.update(time=log["time"] * 1.02), ("mean time step is 0.00102 s", "sampling_period_s")),
    ],
)
def test_a_log_that_is_not_what_was_said_is_refused(bench, spoil, texts):
    log = bench_log()
    spoil(log)
    savemat(bench.folder / "log.mat", log)
    command = ("simulate-or-acquire", "bench.yaml")
    assert bench.robid("design-excitation", "bench.yaml").code == 0
    refuse(bench, 4, "log.mat", *texts, command=command)


def test_a_wrong_period_proposes_the_right_one(bench):
    bench.change("period_s: 0.5", "period_s: 0.502", "bench.yaml")
    bench.change("count: 71", "count: 70", "bench.yaml")
    assert bench.robid("design-excitation", "bench.yaml").code == 0
    refuse(bench, 4, "repeats every 500 samples", "0.5", command=("simulate-or-acquire", "bench.yaml"))


def test_a_missing_data_folder_is_told_before_anything_runs(bench, monkeypatch):
    bench.change("file: log.mat", "file: ${ROBID_DATA}/bench/log.mat", "bench.yaml")
    monkeypatch.setenv("ROBID_DATA", "nowhere")
    refuse(bench, 4, "nowhere/bench/log.mat", "ROBID_DATA", command=("run", "bench.yaml"))
    assert not (bench.runs / "log").exists()


def test_a_model_that_is_not_there_names_the_data_folder(shop, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", "nowhere")
    example = str(Path(__file__).parents[2] / "configs" / "ur5e.yaml")
    refuse(shop, 4, "D215", "set ROBID_DATA", command=("run", example))
    refuse(shop, 2, "ur5e.yaml: model", "no folder nowhere", "set ROBID_DATA", command=("status", example))


def test_a_rigid_model_and_what_is_wrong_with_it_come_at_once(shop):
    robot = shop.folder / "arm.yaml"
    model = "<mujoco><worldbody><body><joint name='turn'/><body name='hand' pos='1 0 0'><joint name='lift'/>"
    (shop.folder / "arm.xml").write_text(f"{model}</body></body></worldbody></mujoco>")
    kept = [
        line for line in robot.read_text().splitlines() if not line.lstrip().startswith(("dh:", "limits_deg:", "link:"))
    ]
    robot.write_text(
        "\n".join([*kept, "model: arm.xml", "total_mass_kg: 3"]).replace("gear_ratio: 100", "gear_ratio: 0", 1)
    )
    texts = ("S317", "joints[1].motor.gear_ratio: S295 0 is implausible")
    refuse(shop, 2, *texts)

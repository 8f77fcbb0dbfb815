"""`robid inspect` of logs: real ones, damaged ones, and what it proposes for simulated ones of every kind."""

import json
import re

import numpy as np
import pytest
from scipy.io import savemat

from log_files import WRITERS
from robid.artifacts.kinds import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.models.known import load_experiment
from settings_tables import ROOT

STEP, PERIOD = 1e-3, 500


@pytest.fixture
def real(shop, monkeypatch, data_folder):
    """Inspects a log of the public data: what was found, and the proposed file, which is loaded."""

    def inspect(*files, options=()):
        folder = data_folder(files[0].partition("/")[0]).parent.resolve()
        monkeypatch.setenv("ROBID_DATA", str(folder))
        answer = shop.robid("inspect", *(str(folder / one) for one in files), "--json", *options)
        assert answer.code == 0, answer.err
        (shop.folder / "proposed.yaml").write_text(filled_in(answer.json["proposal"]))
        return answer.json, load_experiment(shop.folder / "proposed.yaml").experiment.campaigns["log"]

    return inspect


def filled_in(text):
    """A proposal with what a person has to fill in: the counts of a turn, and what a volt stands for."""
    text = text.replace("unit: counts", "unit: counts, counts_per_turn: 4096")
    inputs, outputs = text.partition("outputs:")[::2]
    return (
        f"{inputs.replace('unit: V', 'unit: N m, scale: 2')}outputs:{outputs.replace('unit: V', 'unit: rad, scale: 3')}"
    )


def test_the_proposal_for_the_motor_bench_is_its_example(real):
    _, found = real("motor_bench/MultisineTypeA.mat")
    example = load_experiment(ROOT / "configs/motor_bench.yaml").experiment.campaigns["estimation"]
    mine, theirs = found.source.acquire, example.source.acquire
    for key in ("sampling_period_s", "drop_periods", "time", "inputs", "outputs"):
        assert getattr(mine, key) == getattr(theirs, key), key
    assert found.periods == example.periods
    for key in ("period_s", "low_hz", "high_hz", "grid"):
        assert getattr(found.excitation, key) == getattr(example.excitation, key), key
    assert found.excitation.lines == "all"


def test_the_crane_is_a_command_and_two_encoders(real):
    told, found = real("crane/meas1.mat")
    acquire = found.source.acquire
    assert (acquire.inputs[0].variable, acquire.inputs[0].sign) == ("meas1.Y(4).Data", -1)
    assert [(one.variable, one.unit) for one in acquire.outputs] == [
        ("meas1.Y(1).Data", "counts"),
        ("meas1.Y(2).Data", "counts"),
    ]
    assert (acquire.time.variable, acquire.take, found.periods) == ("meas1.X.Data", "last", 10)
    assert found.excitation.period_s == 163.84
    assert {one["name"]: one["same_as"] for one in told["signals"]}["meas1.Y(5).Data"] == "meas1.Y(4).Data"


def test_the_slide_has_a_drive_a_command_and_a_period_that_nobody_stated(real):
    told, found = real("emps/DATA_EMPS.mat")
    roles = {one["name"]: (one["role"], one["by"], one["commanded"]) for one in told["signals"]}
    assert roles["vir"] == ("torque", "relation", False)
    assert roles["qg"][2]
    assert not roles["qm"][2]
    assert {one["name"]: one["resolution"] for one in told["signals"]}["qm"] == pytest.approx(5e-8, rel=1e-3)
    assert found.excitation.period_s == 6.24
    assert [one.variable for one in found.source.acquire.outputs] == ["qm"]


def test_an_arm_in_two_files_is_one_recording(real):
    options = ("--sampling-period", "2e-4")
    _, found = real("tx40/pos_read_data.csv", "tx40/curr_data.csv", options=options)
    acquire = found.source.acquire
    assert acquire.one_shot
    assert acquire.sampling_period_s == 2e-4
    names = [f"joint_{number}" for number in range(1, 7)]
    assert [one.name for one in acquire.inputs] == [one.name for one in acquire.outputs] == names
    assert {one.file.endswith("curr_data.csv") for one in acquire.inputs} == {True}


def make_columns(periods=6):
    """A drive of two inertias in steady state: torque, both angles, the motor's speed."""
    line = np.arange(5, 100)
    omega = 2 * np.pi * line / (PERIOD * STEP)
    phase = -np.pi * (line - 5) ** 2 / len(line)
    inertia, stiffness, damping = 5e-3, 300.0, 0.2
    spring = stiffness + 1j * omega * damping
    load = spring / (spring - inertia * omega**2)
    motor = 1 / (spring * (1 - load) - inertia * omega**2)

    def wave(response):
        spectrum = np.zeros(PERIOD // 2 + 1, complex)
        spectrum[line] = response * np.exp(1j * phase)
        return np.tile(np.fft.irfft(spectrum, PERIOD), periods) * PERIOD / 2

    return {
        "tau": wave(np.ones(len(line))),
        "theta_motor": wave(motor),
        "theta_load": -wave(motor * load),
        "omega_motor": wave(1j * omega * motor),
    }


@pytest.mark.parametrize("kind", sorted(WRITERS))
def test_the_proposal_imports_a_log_of_every_format(shop, kind):
    write, name = WRITERS[kind]
    columns = make_columns()
    time = STEP * np.arange(len(columns["tau"]))
    if kind in ("mcap", "rosbag"):  # two joints' positions, speeds and efforts, of which one rests
        still = np.zeros(len(time))
        moving = [columns[key] for key in ("theta_motor", "omega_motor", "tau")]
        columns = {f"{index}{joint}": x for index, one in enumerate(moving) for joint, x in (("a", one), ("b", still))}
    else:
        columns = {"time": time, **columns}
    path, names = write(shop.folder / name, columns)
    answer = shop.robid("inspect", str(path), "--propose", "proposed.yaml", "--json")
    assert answer.code == 0, answer.err
    if "unit: V" in answer.json["proposal"]:  # as recorders state whatever they measure
        assert shop.robid("simulate-or-acquire", "proposed.yaml").code == 2
        (shop.folder / "proposed.yaml").write_text(filled_in(answer.json["proposal"]))
    found = load_experiment(shop.folder / "proposed.yaml").experiment.campaigns["log"]
    acquire = found.source.acquire
    assert acquire.sampling_period_s == pytest.approx(STEP, rel=1e-9)
    assert found.excitation.period_s == pytest.approx(PERIOD * STEP)
    assert answer.json["period"]["lines_text"] == "5-99"
    assert {acquire.inputs[0].variable} < set(names.values())
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        done = shop.robid(stage, "proposed.yaml")
        assert done.code == 0, done.err


def test_sides_and_signs_come_from_the_data(shop):
    columns = make_columns()
    plain = {"i": columns["tau"], "phi1a": columns["theta_load"], "phi1b": columns["theta_motor"]}
    savemat(shop.folder / "log.mat", {"iq": plain["i"], "phi_a": plain["phi1a"], "phi_b": plain["phi1b"], "Ts": STEP})
    found = shop.robid("inspect", "log.mat", "--json").json
    (shop.folder / "proposed.yaml").write_text(found["proposal"])
    acquire = load_experiment(shop.folder / "proposed.yaml").experiment.campaigns["log"].source.acquire
    assert [(one.name, one.variable, one.sign) for one in acquire.outputs] == [
        ("drive", "phi_b", 1),
        ("drive.arm", "phi_a", -1),
    ]
    assert re.search(r"variable: phi_a, .*# check: .*sign by how it goes with `phi_b`", found["proposal"])


def test_what_is_wrong_with_a_log_is_said(shop):
    columns = make_columns()
    columns["tau"] = np.clip(columns["tau"], -5, 5)
    columns["theta_load"][40:44] = np.nan
    columns["spare"] = np.zeros(len(columns["tau"]))
    savemat(shop.folder / "log.mat", columns)
    answer = shop.robid("inspect", "log.mat")
    assert answer.code == 0
    flat = " ".join(answer.out.split())
    for told in (
        "saturated?",
        "NaN or infinite at 4 of",
        "never changes",
        "nothing tells the sampling period",
    ):
        assert told in flat
    assert "# check: nothing in the log tells it" in answer.out


def test_a_signal_that_does_not_repeat_gets_a_band(shop):
    rng = np.random.default_rng(2)
    torque = rng.normal(size=8000)
    savemat(shop.folder / "log.mat", {"Ts": 1e-3, "torque": torque, "angle": np.cumsum(np.cumsum(torque)) * 1e-6})
    answer = shop.robid("inspect", "log.mat", "--propose", "noise.yaml")
    assert answer.code == 0
    assert load_experiment(shop.folder / "noise.yaml").experiment.campaigns["log"].is_arbitrary


def coupled(torque):
    """Angles of two coupled inertias with dampers, from rest."""
    inverse, damping = np.linalg.inv([[0.05, 0.01], [0.01, 0.03]]), np.diag([3.0, 2.0])
    speed, angle, angles = np.zeros(2), np.zeros(2), np.zeros_like(torque)
    for at, push in enumerate(torque):
        angles[at] = angle
        speed = speed + 1e-3 * inverse @ (push - damping @ speed)
        angle = angle + 1e-3 * speed
    return angles


def moves(rng):
    """Torque (12000, 2) of short moves to and fro, with pauses."""
    torque = np.zeros((24_000, 2))
    for joint in range(2):
        at, way = 0, 1.0
        while at < len(torque):
            ramp, pause = rng.integers(10, 60), rng.integers(20, 200)
            push = way * rng.uniform(0.4, 1) * np.sin(np.linspace(0, np.pi, ramp)) ** 2
            part = np.concatenate([push, -push, np.zeros(pause)])[: len(torque) - at]
            torque[at : at + len(part), joint] = part
            at, way = at + len(part), -way
    return torque


@pytest.mark.parametrize("signal", ["noise", "moves"])
@pytest.mark.parametrize("gap", [False, True])
def test_signals_of_two_joints_give_a_response_without_a_further_word(shop, signal, gap):
    rng = np.random.default_rng(5)
    torque = rng.normal(size=(24_000, 2)) if signal == "noise" else moves(rng)
    angle = coupled(torque)
    moments = np.arange(24_000) + (0.1 * rng.uniform(-1, 1, 24_000) if gap else 0)
    columns = {"t [ns]": np.round(1e6 * moments), "tau_1 [Nm]": torque[:, 0], "tau_2 [Nm]": torque[:, 1]}
    columns |= {"q_1 [rad]": angle[:, 0], "q_2 [rad]": angle[:, 1]}
    kept = np.delete(np.arange(24_000), np.s_[3000:3040] if gap else [])
    table = np.stack([one[kept] for one in columns.values()], axis=1)
    np.savetxt(shop.folder / "log.csv", table, fmt="%.12g", delimiter=",", header=",".join(columns), comments="")
    assert shop.robid("inspect", "log.csv", "--propose", "two.yaml").code == 0
    text = (shop.folder / "two.yaml").read_text()
    acquire = load_experiment(shop.folder / "two.yaml").experiment.campaigns["log"].source.acquire
    assert acquire.time.unit == "ns"
    # Its moves tell that samples were taken evenly, whatever the stamps say.
    assert acquire.resample == ("time" if gap and signal == "noise" else None)
    assert acquire.is_cut == gap
    answer = shop.robid("run", "two.yaml")
    assert answer.code == 0, answer.err
    assert "2 x 2 response" in answer.out
    # The other use that the comment names works as well.
    text = re.sub(r"    (excitation|estimate): .*\n", "", text)
    (shop.folder / "shot.yaml").write_text(text.replace("        time:", "        one_shot: true\n        time:"))
    assert shop.robid("run", "shot.yaml").code == 0


def test_volts_are_mapped_with_a_scale_to_fill_in(shop):
    columns = make_columns()
    table = {"cmd [V]": columns["tau"], "tacho [V]": columns["omega_motor"], "pos [V]": columns["theta_motor"]}
    np.savetxt(
        shop.folder / "log.csv", np.stack([*table.values()], 1), delimiter=",", header=",".join(table), comments=""
    )
    assert shop.robid("inspect", "log.csv", "--sampling-period", "1e-3", "--propose", "volts.yaml").code == 0
    text = (shop.folder / "volts.yaml").read_text()
    answer = shop.robid("run", "volts.yaml")
    assert answer.code == 2
    assert answer.err.count("what one `V` stands for") == text.count("unit: V") == 2
    assert "scale" in answer.err
    assert "inputs[1].unit" in answer.err
    (shop.folder / "volts.yaml").write_text(filled_in(text))
    acquire = load_experiment(shop.folder / "volts.yaml").experiment.campaigns["log"].source.acquire
    assert [one.variable for one in acquire.inputs] == ["cmd [V]"]
    assert "pos [V]" in [one.variable for one in acquire.outputs]
    assert shop.robid("run", "volts.yaml").code == 0


@pytest.mark.parametrize(
    ("name", "content", "code", "text"),
    [
        ("nothing.csv", None, 4, "does not exist"),
        ("nothing.h5", None, 3, "A008"),
        ("empty.csv", b"", 4, "empty"),
        ("words.csv", b"hello\nworld\n", 4, "no table"),
        ("short.csv", b"a,b\n1,2\n3,4\n", 4, "no signals"),
        ("broken.mat", b"MATLAB 5.0 MAT-file" + bytes(300), 4, "MAT file"),
        ("bag.bag", b"#ROSBAG V2.0\n" + bytes(30), 4, "rosbags-convert"),
    ],
)
def test_what_cannot_be_read_is_one_message(shop, name, content, code, text):
    if content is not None:
        (shop.folder / name).write_bytes(content)
    answer = shop.robid("inspect", name)
    assert answer.code == code, answer.err
    assert text in answer.flat
    assert "remedy: " in answer.err
    assert answer.out == ""


def test_nothing_is_overwritten_but_own_pages(shop):
    savemat(shop.folder / "log.mat", {**make_columns(), "Ts": STEP})
    assert shop.robid("inspect", "log.mat", "--output", "page.html", "--propose", "own.yaml").code == 0
    assert shop.robid("inspect", "log.mat", "--output", "page.html", "--propose", "own.yaml").code == 0
    (shop.folder / "own.yaml").write_text("name: mine\n")
    (shop.folder / "page.html").write_text("mine\n")
    for option, file in (("--propose", "own.yaml"), ("--output", "page.html"), ("--output", "log.mat")):
        before = (shop.folder / file).read_bytes()
        answer = shop.robid("inspect", "log.mat", option, file)
        assert answer.code == 3, answer.err
        assert (shop.folder / file).read_bytes() == before
    assert shop.robid("inspect", "log.mat", "--output", "no/page.html").code == 2
    assert shop.robid("inspect", "log.mat", "--sampling-period", "-1").code == 2


def test_a_dialect_is_said_as_in_the_file(shop):
    columns = make_columns()
    rows = zip(columns["tau"], columns["theta_motor"], strict=True)
    text = "\n".join(f"{a:.12g};{b:.12g}".replace(".", ",") for a, b in rows)
    (shop.folder / "log.csv").write_text(f"recorded today\ntorque;angle\n[Nm];[rad]\n{text}\n")
    said = ("--dialect", "header_line=2", "--dialect", "delimiter=;", "--sampling-period", "1e-3")
    assert shop.robid("inspect", "log.csv", *said, "--propose", "own.yaml").code == 0
    acquire = load_experiment(shop.folder / "own.yaml").experiment.campaigns["log"].source.acquire
    assert (acquire.dialect.header_line, acquire.dialect.delimiter) == (2, ";")
    assert (acquire.inputs[0].variable, acquire.inputs[0].unit) == ("torque", "N m")
    for wrong in ("lines=3", "header_line=x", "decimal"):
        assert shop.robid("inspect", "log.csv", "--dialect", wrong).code == 2


def test_the_proposal_with_the_robot_named_gives_the_record_of_the_example(real, shop):
    real("motor_bench/MultisineTypeA.mat")
    text = (shop.folder / "proposed.yaml").read_text()
    text = text.replace("# robot: my_robot.yaml", f"robot: {ROOT / 'configs/robots/motor_bench.yaml'}")
    text = text.replace("    # configurations:", "    configurations:")
    (shop.folder / "proposed.yaml").write_text(text)
    records = []
    for file, name, folder in (("proposed.yaml", "log", "a"), (ROOT / "configs/motor_bench.yaml", "estimation", "b")):
        for stage in ("design-excitation", "simulate-or-acquire"):
            answer = shop.robid(stage, str(file), "--run-dir", folder)
            assert answer.code == 0, answer.err
        records.append(record_from_artifact(read_artifact(shop.folder / folder / name / "record.h5", RECORD)))
    mine, example = records
    assert np.array_equal(mine.inputs, example.inputs)
    assert np.array_equal(mine.outputs, example.outputs)
    assert np.array_equal(mine.excited_lines, example.excited_lines)


def test_options_of_logs_do_not_belong_to_artifacts(done):
    answer = done.robid("inspect", str(done.runs / "fits/elastic/model.h5"), "--output", "page.html")
    assert answer.code == 2
    assert "--output belongs to logs" in answer.flat


def test_the_page_draws_every_signal(shop):
    columns = make_columns()
    savemat(shop.folder / "log.mat", {**columns, "Ts": STEP})
    assert shop.robid("inspect", "log.mat", "--output", "page.html").code == 0
    page = (shop.folder / "page.html").read_text(encoding="utf-8")
    data = json.loads(page.partition('<script type="application/json" id="data">')[2].partition("</script>")[0])
    assert len(data["figures"]) == 2 * len(columns)
    amplitude = data["figures"][1]["curves"][0]
    at = [
        frequency
        for frequency, size in zip(amplitude["x"], amplitude["y"], strict=True)
        if size is not None and size > 0.5
    ]
    assert (min(at), max(at)) == (10, 198)
    assert "Proposed mapping" in page


def test_experiments_side_by_side_are_no_mixture(shop):
    """Two joints in two experiments: the first torque is a copy, the second one has the other sign."""
    one, time = make_columns(), STEP * np.arange(6 * PERIOD)
    signs = {"exp1": (1, 1), "exp2": (1, -1)}
    pair = {key: (one[key], np.roll(one[key], 137)) for key in ("tau", "theta_motor")}
    log = {
        name: {
            "X": {"t": time},
            "Y": {
                "torque": np.stack(pair["tau"], axis=1) * both,
                "enc": np.stack(pair["theta_motor"], axis=1) * both,
            },
        }
        for name, both in signs.items()
    }
    savemat(shop.folder / "log.mat", log)
    answer = shop.robid("inspect", "log.mat", "--propose", "both.yaml")
    assert answer.code == 0, answer.err
    campaign = load_experiment(shop.folder / "both.yaml").experiment.campaigns["log"]
    acquire = campaign.source.acquire
    assert campaign.experiments == 2
    assert acquire.time.variable == "exp{experiment}.X.t"
    assert [one.variable for one in acquire.inputs] == [f"exp{{experiment}}.Y.torque(:,{axis})" for axis in (1, 2)]
    assert [one.variable for one in acquire.outputs] == [f"exp{{experiment}}.Y.enc(:,{axis})" for axis in (1, 2)]
    for stage in ("design-excitation", "simulate-or-acquire"):
        done = shop.robid(stage, "both.yaml")
        assert done.code == 0, done.err
    record = record_from_artifact(read_artifact(shop.folder / "runs/both/log/record.h5", RECORD))
    np.testing.assert_allclose(record.inputs[0, 0, 1], record.inputs[0, 0, 0] * [1, -1])


def test_what_was_not_found_is_a_line_to_fill_in(shop):
    time = STEP * np.arange(6 * PERIOD)
    savemat(shop.folder / "log.mat", {"t": time, "theta_motor": make_columns()["theta_motor"]})
    answer = shop.robid("inspect", "log.mat", "--propose", "half.yaml")
    assert answer.code == 0, answer.err
    text = (shop.folder / "half.yaml").read_text()
    assert "[]" not in text
    assert shop.robid("simulate-or-acquire", "half.yaml").code == 2
    filled = text.replace("# inputs: [{name: drive, variable: NAME,", "inputs: [{name: drive, variable: theta_motor,")
    assert filled != text
    (shop.folder / "half.yaml").write_text(filled)
    load_experiment(shop.folder / "half.yaml")


@pytest.mark.parametrize(
    ("cuts", "drop", "periods", "take"),
    [
        ([(4 * PERIOD + 100, 5 * PERIOD + 100)], 0, 4, "first"),  # the first part is the longest
        ([(2 * PERIOD + 100, 3 * PERIOD + 100)], 3, 4, "first"),  # the second one
        ([(PERIOD + 100, PERIOD + 131)], 0, 6, "last"),  # counted from the end it holds one more
        ([(100, 100 + PERIOD), (6 * PERIOD + 10, 6 * PERIOD + 20)], 1, 4, "first"),  # one between two gaps
    ],
)
def test_the_longest_part_without_a_gap_is_used(shop, cuts, drop, periods, take):
    columns = make_columns(8)
    columns = {"t": STEP * np.arange(8 * PERIOD), **{key: columns[key] for key in ("tau", "theta_motor")}}
    lost = np.concatenate([np.arange(*cut) for cut in cuts])
    savemat(shop.folder / "log.mat", {key: np.delete(one, lost) for key, one in columns.items()})
    answer = shop.robid("inspect", "log.mat", "--propose", "gap.yaml")
    assert answer.code == 0, answer.err
    campaign = load_experiment(shop.folder / "gap.yaml").experiment.campaigns["log"]
    acquire = campaign.source.acquire
    assert (acquire.drop_periods, campaign.periods, acquire.take) == (drop, periods, take)
    for stage in ("design-excitation", "simulate-or-acquire"):
        done = shop.robid(stage, "gap.yaml")
        assert done.code == 0, done.err

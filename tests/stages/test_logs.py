"""Logs of a whole campaign: what was exported is played, logged, matched back, and gives the same response."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from robid.artifacts.kinds import (
    EXCITATION,
    FRF,
    RECORD,
    excitation_from_artifact,
    frf_from_artifact,
    record_from_artifact,
)
from robid.artifacts.store import read_artifact

STEP_S = 1e-3
ACQUIRE = """    source:
      acquire:
        file: logs/c{configuration}_r{realization:02d}_e{experiment}.%s
        format: %s
        sampling_period_s: 1.0e-3
        time: {variable: t, unit: ms}
        inputs: [{name: turn, variable: "%s"}, {name: lift, variable: "%s"}]
        outputs: [{name: turn, variable: q1, unit: deg, sign: -1}, {name: lift, variable: q2, scale: 0.5}]
        references: [{name: turn, variable: ref1}, {name: lift, variable: ref2, unit: rpm}]
    estimate: {compensation: none}
"""


def read(shop, name, kind, convert):
    return convert(read_artifact(shop.runs / "estimation" / name, kind))


def write_log(path, columns):
    if path.suffix == ".mat":
        torque = np.stack([columns.pop("u1"), columns.pop("u2")], axis=1)
        savemat(path, {"rec": {"torque": torque}, **columns})
        return
    if path.suffix == ".h5":
        with h5py.File(path.parent / "all.h5", "a") as file:
            for name, values in columns.items():
                file[f"{path.stem.replace('_e', '/e')}/{name}"] = values
        return
    lines = ["# made by a controller", ";".join(columns)]
    rows = zip(*columns.values(), strict=True)
    lines += [";".join(f"{value:.17g}".replace(".", ",") for value in row) for row in rows]
    path.write_text("\n".join(lines))


def wrap(block, start, end):
    """Periods (n_period, n_sample) as a log that begins before and ends after them."""
    return np.concatenate([block[-1][-start:] if start else block[-1][:0], block.ravel(), block[0][:end]])


def write_logs(folder, record, suffix, order=None, *, aligned=False):
    """Logs of a record: from a random moment on, in other units, signs and scales."""
    generator = np.random.default_rng(4)
    folder.mkdir()
    n_conf, n_real, n_exp, n_period, n_sample = record.inputs.shape[:5]
    for index in np.ndindex(n_conf, n_real, n_exp):
        start, end = (int(n) * (not aligned) for n in generator.integers(0, n_sample, 2))
        torque, angle = record.inputs[index], record.outputs[index] + record.output_offset[index[0]]
        reference = np.broadcast_to(record.reference[index], (n_period, *record.reference[index].shape))
        columns = {
            "u1": torque[..., 0],
            "u2": torque[..., 1],
            "q1": -np.degrees(angle[..., 0]),
            "q2": 2 * angle[..., 1],
            "ref1": reference[..., 0] + 1e-6 * generator.standard_normal(reference.shape[:2]),
            "ref2": reference[..., 1] * 30 / np.pi,
        }
        log = {name: wrap(block, start, end) for name, block in columns.items()}
        log["t"] = 1e3 * STEP_S * np.arange(len(log["u1"]))
        c, r, e = (order or {}).get(index, index)
        write_log(folder / f"c{c + 1}_r{r + 1:02d}_e{e + 1}{suffix}", log)


def switch_to_logs(shop, suffix):
    text = (shop.folder / "small.yaml").read_text()
    begin, end = text.index("    source:\n      simulate: &simulate"), text.index("  validation:")
    torques = ("rec.torque(:,1)", "rec.torque(:,2)") if suffix == "mat" else ("u1", "u2")
    acquire = ACQUIRE % (suffix, suffix, *torques)
    simulate = text[begin:end].replace("    source:\n      simulate: &simulate", "").split("    estimate")[0]
    validation = text[end:].replace("source: {simulate: {<<: *simulate, seed: 2}}", "source: {simulate: {seed: 2}}")
    assert simulate.strip().startswith("transient_periods")
    (shop.folder / "small.yaml").write_text(text[:begin] + acquire + validation)


@pytest.mark.parametrize("suffix", ["mat", "csv"])
def test_logs_of_a_campaign_give_the_response_of_the_record_they_come_from(done, suffix):
    record = read(done, "record.h5", RECORD, record_from_artifact)
    done.change("compensation: nominal", "compensation: none")
    assert done.robid("estimate-frf", "small.yaml", "--campaign", "estimation", "--force").code == 0
    wanted = read(done, "frf.h5", FRF, frf_from_artifact)
    write_logs(done.folder / "logs", record, f".{suffix}")
    switch_to_logs(done, suffix)
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = done.robid(stage, "small.yaml", "--campaign", "estimation", "--force")
        assert answer.code == 0, answer.err
    found = read(done, "record.h5", RECORD, record_from_artifact)
    np.testing.assert_allclose(found.inputs, record.inputs, atol=1e-6)
    np.testing.assert_allclose(
        np.diff(found.outputs, axis=4), np.diff(record.outputs, axis=4), atol=1e-6 * np.ptp(record.outputs)
    )
    played = read(done, "excitation.h5", EXCITATION, excitation_from_artifact).excitation
    assert {channel.quantity for channel in found.reference_channels} == {"speed_reference"}
    for reference in found.reference:
        np.testing.assert_allclose(reference, played.reference, atol=1e-5)
    response = read(done, "frf.h5", FRF, frf_from_artifact).response
    scale = np.abs(wanted.response).max(axis=(1, 2, 3), keepdims=True)
    np.testing.assert_allclose(response / scale, wanted.response / scale, atol=2e-6)


def test_one_file_holds_all_experiments_under_numbered_roots(done):
    record = read(done, "record.h5", RECORD, record_from_artifact)
    write_logs(done.folder / "logs", record, ".h5")
    switch_to_logs(done, "hdf5")
    done.change("logs/c{configuration}_r{realization:02d}_e{experiment}.hdf5", "logs/all.h5")
    for name in ("t", '"u1"', '"u2"', "q1", "q2", "ref1", "ref2"):
        numbered = f'variable: "c{{configuration}}_r{{realization:02d}}/e{{experiment}}/{name.strip(chr(34))}"'
        done.change(f"variable: {name}", numbered)
    for stage in ("design-excitation", "simulate-or-acquire"):
        answer = done.robid(stage, "small.yaml", "--campaign", "estimation", "--force")
        assert answer.code == 0, answer.err
    found = read(done, "record.h5", RECORD, record_from_artifact)
    np.testing.assert_allclose(found.inputs, record.inputs, atol=1e-6)
    assert done.states()["estimation/record.h5"][0] == "fresh"
    with h5py.File(done.folder / "logs" / "all.h5", "r+") as file:
        file["c1_r01/e1/q1"][0] += 1
    state, why = done.states()["estimation/record.h5"]
    assert state == "stale"
    assert "input log of configuration 2, realization 1, experiment 1 changed" in why


def test_logs_without_references_begin_where_they_are_said_to(done):
    record = read(done, "record.h5", RECORD, record_from_artifact)
    write_logs(done.folder / "logs", record, ".csv", aligned=True)
    switch_to_logs(done, "csv")
    done.change("        references: [{name: turn, variable: ref1}, {name: lift, variable: ref2, unit: rpm}]\n", "")
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = done.robid(stage, "small.yaml", "--campaign", "estimation", "--force")
        assert answer.code == 0, answer.err
    found = read(done, "record.h5", RECORD, record_from_artifact)
    assert found.reference is None
    np.testing.assert_allclose(found.inputs, record.inputs, atol=1e-6)
    np.testing.assert_array_equal(found.excited_lines, record.excited_lines)
    assert found.notes[0].startswith("Imported from c{configuration}_r{realization:02d}_e{experiment}.csv, periods")
    answer = done.robid("export", "small.yaml", "--campaign", "estimation", "--format", "csv")
    assert answer.code == 3
    assert "A031" in answer.flat


@pytest.fixture
def logged(done):
    """The small experiment, its estimation campaign switched to logs of its own record."""
    record = read(done, "record.h5", RECORD, record_from_artifact)
    write_logs(done.folder / "logs", record, ".csv")
    switch_to_logs(done, "csv")
    return done


def refuse(shop, *texts, command="simulate-or-acquire"):
    assert shop.robid("design-excitation", "small.yaml", "--campaign", "estimation", "--force").code == 0
    options = () if command == "run" else ("--campaign", "estimation", "--force")
    answer = shop.robid(command, "small.yaml", *options)
    assert answer.code == 4, answer.err
    for text in ("small.yaml: campaigns.estimation", *texts):
        assert text in answer.flat
    return answer.flat


def test_the_excitation_is_designed_and_exported_before_there_is_a_log(shop):
    switch_to_logs(shop, "csv")
    shop.change("from: best", "list_deg: [[10, 20], [0, -10]]")
    assert shop.robid("design-excitation", "small.yaml", "--campaign", "estimation").code == 0
    answer = shop.robid("export", "small.yaml", "--campaign", "estimation", "--format", "csv", "--json")
    assert len(answer.json["files"]) == 4
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 4
    assert "log of configuration 1, realization 1, experiment 1 of campaign estimation" in answer.flat
    assert "nor do 7 more of its 8" in answer.flat


@pytest.mark.slow
def test_logs_are_imported_in_parallel(logged):
    assert logged.robid("design-excitation", "small.yaml", "--campaign", "estimation", "--force").code == 0
    command = ("simulate-or-acquire", "small.yaml", "--campaign", "estimation", "--force")
    assert logged.robid(*command).code == 0
    before = logged.contents()["estimation/record.h5"]
    assert logged.robid(*command, "--backend", "processes", "--workers", "2").code == 0
    assert logged.contents()["estimation/record.h5"] == before


def test_each_log_counts(logged):
    for stage in ("design-excitation", "simulate-or-acquire"):
        assert logged.robid(stage, "small.yaml", "--campaign", "estimation", "--force").code == 0
    with (logged.folder / "logs" / "c2_r01_e2.csv").open("a") as file:
        file.write("\n")
    why = "input log of configuration 2, realization 1, experiment 2 changed"
    assert logged.states()["estimation/record.h5"] == ("stale", why)


def test_exchanged_logs_are_named(done):
    record = read(done, "record.h5", RECORD, record_from_artifact)
    order = {(0, 0, 0): (0, 1, 0), (0, 1, 0): (0, 0, 0)}
    write_logs(done.folder / "logs", record, ".csv", order)
    switch_to_logs(done, "csv")
    refuse(done, "c1_r01_e1.csv", "It contains realization 2, experiment 1 of the excitation, not realization 1")


@pytest.mark.parametrize(
    ("old", "new", "texts"),
    [
        (
            "variable: ref1",
            "variable: reff1",
            ("`reff1`: D040", "Did you mean `ref1` or `ref2`?"),
        ),
        ("variable: ref2, unit: rpm", "variable: ref2", ("lift 9.549 times, as rpm for rad/s", "unit or scale")),
        ("variable: ref2, unit: rpm", "variable: ref1", ("references of lift are not those of the excitation",)),
        (
            "excitation: *excitation\n",
            "excitation: {<<: *excitation, seed: 7}\n",
            ("D239", "over all 2 realizations of 2 experiments"),
        ),
        (
            "    periods: 2\n    source:\n      acquire",
            "    periods: 3\n    source:\n      acquire",
            ("fewer than the 3", "set periods to 2"),
        ),
        ("unit: ms", "unit: s", ("time unit is off by a factor of 1000",)),
        ("format: csv", "format: mat", ("cannot be read as a MAT file",)),
        ("format: csv", "dialect: {header_line: 7}", ("D040", "The log contains")),
    ],
)
def test_a_log_that_is_not_what_was_said_is_refused(logged, old, new, texts):
    logged.change(old, new)
    refuse(logged, "c1_r01_e1.csv", *texts)


def test_a_broken_line_is_located(logged):
    path = logged.folder / "logs" / "c1_r02_e2.csv"
    lines = path.read_text().splitlines()
    lines[700] = lines[700].rpartition(";")[0]
    path.write_text("\n".join(lines))
    refuse(logged, "c1_r02_e2.csv, line 701", "6 values for 7 columns")


@pytest.mark.parametrize(("column", "lost"), [("u1", "nan"), ("q2", "NaN"), ("q2", "inf"), ("ref1", "nan")])
def test_a_value_that_is_no_number_is_located(logged, column, lost):
    path = logged.folder / "logs" / "c2_r02_e1.csv"
    lines = path.read_text().splitlines()
    at = lines[1].split(";").index(column)
    values = lines[702].split(";")
    lines[702] = ";".join([*values[:at], lost, *values[at + 1 :]])
    path.write_text("\n".join(lines))
    place = f"c2_r02_e1.csv: variable `{column}`, sample 700: D043 1 of "
    text = refuse(logged, place, "remedy: Set resample to time", command="run")
    assert text.count("robid: ") == 1
    logged.change("time: {variable", "resample: time\n        time: {variable")
    assert logged.robid("simulate-or-acquire", "small.yaml", "--campaign", "estimation", "--force").code == 0


def test_lost_samples_are_located(logged):
    path = logged.folder / "logs" / "c2_r01_e1.csv"
    lines = path.read_text().splitlines()
    del lines[600:605]
    path.write_text("\n".join(lines))
    refuse(logged, "c2_r01_e1.csv", "1 gap, about 5 missing samples", "after sample 597")

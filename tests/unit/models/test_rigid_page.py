"""What the page shows of a rigid fit: errors, torques over time, friction on both sides, and one voice of its tests."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.parameters import extremes, parameter_rows
from robid.models.rigid.fit.cut_off import row_count
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.judge.joint_side import to_joint_side
from robid.models.rigid.judge.motors import motors_of
from robid.models.rigid.judge.plausible import estimator_findings
from robid.models.rigid.judge.validating import validate_rigid
from robid.models.rigid.page.content import RigidContent
from robid.models.rigid.page.estimators import estimators_section, grade_sentence
from robid.models.rigid.page.friction import friction_section
from robid.models.rigid.page.motors import motors_section
from robid.models.rigid.page.report import sections
from robid.models.rigid.page.torques import courses_of, joined, short_names, torque_section
from robid.report.numbers import MINUS, MISSING
from robid.report.page import ReportContent, Verdict, render
from robid.report.parameters import Estimates
from robid.report.section import Figure
from robid.results.grade import DO_NOT_USE, PREDICTS, TRUST, grade_alone, grade_held

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)
OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
LENGTHS = (3000, 1500, 2000)
NAMES = ("joint_0", "joint_1", "joint_2")


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def shots(robot):
    found = [shot_along(robot, fourier_motion(robot, length, seed=length)) for length in LENGTHS]
    return [replace(shot, name=f"log {index}") for index, shot in enumerate(found)]


@pytest.fixture(scope="module")
def solution(robot, shots):
    return fit_rigid(robot, shots, OPTIONS)


@pytest.fixture
def content(robot, solution):
    joints = [replace(joint, name=name) for joint, name in zip(robot.joints, NAMES, strict=True)]
    estimates = Estimates(parameter_rows(solution.estimate, {}))
    return RigidContent(solution, estimates, motors_of(solution, NAMES), joints)


def test_each_record_has_its_own_rows(solution, content):
    counts = [row_count(length, OPTIONS.filters, PERIOD_S) for length in LENGTHS]
    own, new = courses_of(content)
    assert new == []
    assert [course.name for course in own] == ["log 0", "log 1", "log 2"]
    assert [len(course.time_s) for course in own] == counts
    first = counts[0]
    np.testing.assert_array_equal(own[1].measured, solution.residuals.torque[first : first + counts[1]])
    np.testing.assert_allclose(own[1].measured - own[1].predicted, solution.residuals.residual[first:][: counts[1]])
    assert all(course.time_s[0] == 0 for course in own)


def test_a_row_is_of_the_record_whose_torques_it_has(robot, shots):
    # Each record's torques are made so much larger than those of the one before that its rows tell it.
    marked = [replace(shot, torque=shot.torque + 1e4 * index) for index, shot in enumerate(shots)]
    found = fit_rigid(robot, marked, OPTIONS).residuals
    np.testing.assert_array_equal(found.shot, np.round(found.torque[:, 0] / 1e4))


def test_joined_records_have_a_gap_and_a_named_mark(content):
    own, _ = courses_of(content)
    whole = joined(own, "all")
    assert [name for _, name in whole.begins] == ["log 0", "log 1", "log 2"]
    assert len(whole.time_s) == sum(len(course.time_s) for course in own) + len(own)
    assert (np.diff(whole.time_s) > 0).all()
    for start, _ in whole.begins[1:]:
        index = int(np.searchsorted(whole.time_s, start))
        assert whole.time_s[index] == start
        assert np.isnan(whole.measured[index - 1]).all()
    (choice,) = torque_section(content).parts
    figures = dict(choice.options)
    torque, residual = figures["joint_1", "all after each other (fit)"]
    assert [(line.along, line.name) for line in torque.lines] == [("x", f"log {index}") for index in range(3)]
    assert [line.at for line in residual.lines if line.along == "x"] == [at for at, _ in whole.begins]


def test_every_motor_and_record_is_shown_with_its_residual(robot, solution, content):
    new = replace(shot_along(robot, fourier_motion(robot, 2500, seed=8), noise=0.05), name="another")
    validation = validate_rigid(robot, solution, [new], OPTIONS)
    (choice,) = torque_section(replace(content, validation=validation)).parts
    records = [*(f"log {index} (fit)" for index in range(3)), "all after each other (fit)", "another (validation)"]
    assert [names for names, _ in choice.options] == [(name, record) for name in NAMES for record in records]
    for _, (torque, residual) in choice.options:
        assert isinstance(torque, Figure)
        assert [curve.name for curve in torque.curves] == ["measured", "predicted"]
        assert [curve.name for curve in residual.curves] == ["measured less predicted"]
    _, (torque, residual) = choice.options[4]
    measured, predicted = validation.prediction.measured[:, 0], validation.prediction.predicted[:, 0]
    assert max(torque.curves[0].y) == pytest.approx(measured.max())
    assert max(torque.curves[1].y) == pytest.approx(predicted.max())
    assert max(map(abs, residual.curves[0].y)) == pytest.approx(np.abs(measured - predicted).max())


def test_marks_have_short_names():
    assert short_names(["day, realization 1", "day, realization 2"]) == ["realization 1", "realization 2"]
    assert short_names(["day, realization 1", "night"]) == ["day, realization 1", "night"]
    assert short_names(["day", "day"]) == ["day", "day"]


def test_peaks_survive_thinning():
    rng = np.random.default_rng(1)
    x, y = np.arange(10_000.0), rng.standard_normal(10_000)
    y[4321], y[7777] = 50.0, -60.0
    y[2000:3000] = np.nan
    y[6000] = np.nan  # one row between two records
    kept_x, kept_y = extremes(x, y, 200)
    assert len(kept_x) <= 210
    assert np.isnan(kept_y[(kept_x > 5900) & (kept_x < 6100)]).any(), "the gap is closed"
    assert (np.diff(kept_x) > 0).all()
    assert (np.nanmax(kept_y), np.nanmin(kept_y)) == (50.0, -60.0)
    np.testing.assert_array_equal(kept_y, y[kept_x.astype(int)])
    inside = (kept_x > 2100) & (kept_x < 2900)
    assert inside.any()
    assert np.isnan(kept_y[inside]).all()
    assert extremes(x[:50], y[:50], 200)[0] is not kept_x
    np.testing.assert_array_equal(extremes(x[:50], y[:50], 200)[1], y[:50])


def test_each_motors_errors_stand_first(robot, solution, content):
    new = shot_along(robot, fourier_motion(robot, 2500, seed=8), noise=0.05)
    validation = validate_rigid(robot, solution, [new], OPTIONS)
    expected = replace(solution.expected, rated=np.array([2.0, 3.0, 4.0]), stated=np.array([True, False, True]))
    shown = replace(content, validation=validation, solution=replace(solution, expected=expected))
    first, *_ = sections(shown)
    (table,) = first.tables
    column = {head: [row[place] for row in table.texts] for place, head in enumerate(table.columns)}
    assert column["Motor"] == list(NAMES)
    found, error = solution.residuals, validation.prediction.measured - validation.prediction.predicted
    sizes = {"Torque": found.torque, "Error": found.residual, "Torque, new": validation.prediction.measured}
    for head, values in {**sizes, "Error, new": error}.items():
        written = [float(text.split()[0]) for text in column[head]]
        np.testing.assert_allclose(written, np.sqrt(np.nanmean(values**2, axis=0)), rtol=6e-3)
    share = 100 * np.sqrt(np.nanmean(error**2, axis=0)) / np.array([2.0, 3.0, 4.0])
    written = [text.removesuffix(" %") for text in column["of rated, new"]]
    assert [float(written[0]), float(written[2])] == pytest.approx([share[0], share[2]], rel=0.06)
    assert written[1] == MISSING
    assert "expected" not in column
    alone = motors_section(content).tables[0].columns
    assert {"expected", "95 % below"} <= set(alone)
    assert not any("rated" in head for head in alone), "the robot file states none"


def test_friction_at_the_joint_does_the_same_work(robot):
    # A motor's friction takes `F w` of power: at the joint, with v = w / r, it has to be the same.
    own, ratio, speed = robot.joints[0], -80.0, 0.7
    powers = {
        "coulomb": lambda value, v: value * abs(v),
        "viscous": lambda value, v: value * v**2,
        "quadratic_viscous": lambda value, v: value * abs(v) ** 3,
    }
    for slides in ("revolute", "prismatic"):
        joint = replace(own, type=slides, motor=replace(own.motor, gear_ratio=ratio))
        for kind, power in powers.items():
            factor, _ = to_joint_side(kind, joint)
            assert power(factor * 0.3, speed) == pytest.approx(power(0.3, speed * ratio))
        assert to_joint_side("load_friction", joint) == (1.0, "1")
    units = {kind: to_joint_side(kind, joint)[1] for kind in powers}
    assert units == {"coulomb": "N", "viscous": "N s/m", "quadratic_viscous": "N s^2/m^2"}
    turning = replace(joint, type="revolute")
    assert [to_joint_side(kind, turning)[1] for kind in ("coulomb", "viscous")] == ["N m", "N m s/rad"]


def test_friction_stands_on_both_sides_with_its_intervals(content):
    joints = [replace(joint, motor=replace(joint.motor, gear_ratio=-50.0)) for joint in content.joints]
    rows = [replace(row, name=NAMES[0]) for row in content.estimates.rows if row.kind == "viscous"][:1]
    rows.append(replace(rows[0], name=f"{NAMES[0]}.viscous_forward"))
    shown = replace(content, joints=joints, estimates=replace(content.estimates, rows=tuple(rows)))
    (section,) = friction_section(shown)
    (table,) = section.tables
    plain, forward = table.texts
    notes = [row.note for row in table.rows]
    assert table.columns[1:7] == ("Joint side", "95 % interval", "Unit", "Motor side", "95 % interval", "Unit")
    assert plain[3] == "N m s/rad"
    assert plain[6].endswith("N m s/rad")
    for text, value in zip(
        (plain[1], *plain[2].split(" … ")), (rows[0].estimate, rows[0].lower, rows[0].upper), strict=True
    ):
        assert float(text.replace(MINUS, "-")) == pytest.approx(2500 * value, rel=0.02)
    prefix = {"N": 1.0, "m": 1e-3, "µ": 1e-6, "k": 1e3}[plain[6][0]]
    assert prefix * float(plain[4]) == pytest.approx(rows[0].estimate, rel=0.02)
    assert "backward at the joint" in notes[1], "the gear reverses"
    assert not notes[0].endswith("joint")
    assert forward[:3] != plain[:3]


def graded(value, findings):
    if value == DO_NOT_USE:
        return grade_alone([each.message for each in findings if each.decisive] or ["poor"], (), findings)
    return grade_held((), ["some"] if value == PREDICTS else (), findings)


@pytest.mark.parametrize("value", [DO_NOT_USE, PREDICTS, TRUST])
def test_the_tests_speak_with_the_voice_of_the_grade(content, value):
    checks = replace(content.solution.checks, trust=False, coloured=True, huber_differs=False, odd=False)
    shown = replace(content, solution=replace(content.solution, checks=checks))
    findings = tuple(estimator_findings(shown.solution, NAMES))
    assert findings
    shown = replace(shown, grade=graded(value, findings))
    told = estimators_section(shown).lead + estimators_section(shown).title
    assert not re.search("trust", told, re.IGNORECASE) or value == TRUST
    assert ("do not use" in told) == (value == DO_NOT_USE)
    other = "for other reasons"
    assert (other in grade_sentence(shown)) == (value == DO_NOT_USE), "nothing decisive was found by the tests"
    decisive = tuple(replace(each, decisive=True) for each in findings)
    if value == DO_NOT_USE:
        assert other not in grade_sentence(replace(shown, grade=graded(value, decisive)))


def test_parameters_that_differ_are_named_with_the_difference(content):
    n_param = len(content.solution.estimate.names)
    variation, chance = np.full(n_param, 0.001), np.ones(n_param)
    variation[[2, 5]], chance[[2, 5]] = (0.12, 0.31), 1e-9
    variation[1] = 0.9  # far off, but by chance
    checks = replace(
        content.solution.checks,
        trust=False,
        instruments_differ=True,
        instrument_variation=variation,
        instrument_p=chance,
    )
    notes = estimators_section(replace(content, solution=replace(content.solution, checks=checks))).parts[0].items
    names = content.solution.estimate.names
    assert f"2 of {n_param} parameters differ by more than chance: {names[5]} by 31 %, {names[2]} by 12 %." in notes[0]
    assert "instrumental variables" in notes[0]
    quiet = estimators_section(content).parts[0].items
    assert "not computed" in " ".join(quiet)


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_torques_of_every_motor_and_record_are_drawn(tmp_path, content):
    path = tmp_path / "report.html"
    page = render(ReportContent("arm", Verdict("It predicts.", "warn"), "", sections=sections(content)))
    script = """{
      const seen = [], frame = document.querySelector('[data-choices]');
      const note = () => seen.push([...frame.querySelectorAll('.chart')].filter((one) => one.clientWidth).map(
        (one) => [one.querySelectorAll('.legend .traces').length, one.layout.shapes.length, one.data[0].y[0]]));
      note();
      frame.querySelector('[aria-label="next motor"]').click(); note();
      frame.querySelector('[aria-label="previous record"]').click(); note();
      document.title = JSON.stringify(seen);
    }"""
    path.write_text(page.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8")
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync")
    quiet = ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
    command = [CHROMIUM, *flags, *quiet, "--virtual-time-budget=8000", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run(
        [*command, "--dump-dom", path.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    first, motor, joined_up = json.loads(re.search(r"<title>(.*?)</title>", done.stdout).group(1))
    # Legends of both figures; three deviations beneath; the marks of three records where they are joined.
    assert [[legend, marks] for legend, marks, _ in first] == [[2, 0], [1, 2]]
    assert [[legend, marks] for legend, marks, _ in joined_up] == [[2, 3], [1, 5]]
    torque = content.solution.residuals.torque
    assert first[0][2] == pytest.approx(torque[0, 0], rel=1e-4)
    assert motor[0][2] == pytest.approx(torque[0, 1], rel=1e-4)

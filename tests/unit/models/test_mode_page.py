"""Modes on the page of an elastic fit: what is said of them, how they are drawn, and the links to and fro."""

from dataclasses import replace

import numpy as np

from robid.models.elastic.page.modes import mode_of, mode_section, mode_sentence, picture_scale
from robid.models.elastic.page.report import sections
from robid.report.numbers import MISSING
from robid.report.section import Cell
from sample_reports import SPRINGS, arm_report, bench_report


def section_of(fit, anchor):
    (found,) = [section for section in sections(fit) if section.anchor == anchor]
    return found


def test_a_sentence_names_the_springs_that_store_the_most():
    shares = np.array([0.03, 0.71, 0.2, 0.06, 0.0, 0.0])
    told = mode_sentence(12.345, 0.021, shares, SPRINGS)
    assert "12.35 Hz" in told
    assert "71 % gear_2, 20 % gear_3, 6.0 % gear_4, 3.0 % in" in told
    assert "gear_1" not in told
    assert mode_sentence(5.0, 0.1, np.eye(6)[0], SPRINGS).endswith(" 100 % gear_1.")


def test_the_table_has_each_springs_share_and_leads_to_the_picture():
    fit = arm_report().fit
    arms, table = section_of(fit, "modes").parts
    assert table.columns[-6:] == SPRINGS
    assert len(table.rows) == sum(each.frequency_hz.size for each in fit.views.modes)
    anchors = [motion.anchor for motions in arms.motions for motion in motions]
    links = [row.cells[1].link for row in table.rows]
    assert links == [f"#{anchor}" for anchor in anchors]
    assert len(set(anchors)) == len(anchors)
    assert list(table.rows[0].cells[-6:]) == ["70 %", "28 %", *[MISSING] * 4]


def test_a_resonance_and_its_mode_lead_to_each_other():
    fit = arm_report().fit
    (resonances, *_), (_, modes) = section_of(fit, "resonances").parts, section_of(fit, "modes").parts
    rows = {f"#{row.anchor}": row for row in resonances.rows}
    seen = [row.cells[3] for row in modes.rows]
    assert seen[3] == MISSING  # nothing shows the fourth mode
    for place, cell in enumerate(seen):
        if isinstance(cell, Cell):
            row = rows[cell.link]
            assert row.cells[1] == cell.text
            assert row.cells[10].link == modes.rows[place].cells[1].link
            assert row.cells[10].text == modes.rows[place].cells[1].text
    linked = [row for row in resonances.rows if isinstance(row.cells[10], Cell)]
    assert len(linked) == 9
    assert all("▲" in row.cells[2] for row in linked)


def test_only_a_resonance_at_a_modes_frequency_is_of_it():
    fit = arm_report().fit
    row = next(row for row in fit.resonances if row.kind == "resonance")
    modes = fit.views.modes
    assert mode_of(row, modes) == 0
    assert mode_of(replace(row, kind="antiresonance"), modes) is None
    assert mode_of(replace(row, mode_hz=row.mode_hz * 1.001), modes) is None
    assert mode_of(replace(row, mode_hz=None), modes) is None
    assert mode_of(row, ()) is None


def test_pictures_move_by_a_readable_share_of_the_arm_and_never_twist_the_tool_too_far():
    modes = arm_report().fit.views.modes[0]
    moved = modes.shape * picture_scale(modes)[:, None, None]
    largest = np.linalg.norm(moved, axis=2).max(axis=1)
    assert (largest < 0.13 * modes.length_m).all()
    turned = np.linalg.norm(moved[:, -2:] - moved[:, -3:-2], axis=2)
    assert (turned <= 0.6 * 0.15 + 1e-12).all()
    stiff = replace(modes, shape=np.where(np.arange(7)[:, None] >= 4, modes.shape[:, 4:5], modes.shape))
    sizes = np.linalg.norm(stiff.shape, axis=2).max(axis=1) * picture_scale(stiff)
    np.testing.assert_allclose(sizes, 0.12 * modes.length_m * np.linalg.norm(stiff.shape, axis=2).max(axis=1))
    spin = np.zeros((1, 7, 3), complex)
    spin[0, -2, 1] = 1.0
    (size,) = picture_scale(replace(modes, shape=spin, length_m=0.0))
    np.testing.assert_allclose(size, 0.6 * 0.15)


def test_a_picture_is_the_real_part_of_a_turning_shape():
    fit = arm_report().fit
    arms = mode_section(fit.views.modes, SPRINGS, fit.frf, "elastic", ())[0].parts[0]
    modes, phase = fit.views.modes[1], 0.7
    motion = arms.motions[1][3]
    found = np.array(motion.cosine) * np.cos(phase) + np.array(motion.sine) * np.sin(phase)
    expected = np.real(modes.shape[3] * np.exp(1j * phase)) * picture_scale(modes)[3]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_a_fit_without_modes_has_no_such_section():
    assert not [each for each in sections(bench_report().fit) if each.anchor in ("modes", "residuals")]

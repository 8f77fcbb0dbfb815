"""The page in a real browser: no console error, figures drawn, screenshots to look at."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import unescape

import numpy as np
import pytest

from robid.frf.replay import Replay
from robid.models.elastic.page.signals import Signals, signal_section
from robid.report.page import ReportContent, Verdict, render
from robid.report.reached import Plane, ReachedRow, reached_section
from robid.report.section import Choices, Curve, Figure, Section

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--enable-logging=stderr",
    "--virtual-time-budget=8000",
)
DARK = "--blink-settings=preferredColorScheme=0"

pytestmark = [pytest.mark.browser, pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")]


def open_page(path, tmp_path, *arguments):
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", *arguments, path.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def add_script(path, script):
    changed = path.with_name(f"scripted-{path.name}")
    changed.write_text(
        path.read_text(encoding="utf-8").replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8"
    )
    return changed


@pytest.mark.parametrize("which", ["arm", "bench"])
def test_all_figures_are_drawn_without_a_complaint(which, tmp_path, request):
    sample = request.getfixturevalue(which)
    page = tmp_path / "report.html"
    page.write_text(render(sample.content), encoding="utf-8")
    html, console = open_page(page, tmp_path, "--dump-dom", "--window-size=1400,2600")
    assert console == []
    _, _, n_out, n_in = sample.fit.frf.response.shape
    assert len(re.findall(r'class="cell"', html)) == n_out * n_in
    assert len(re.findall(r'class="subplot ', html)) >= n_out * n_in
    # Of a single start there is nothing to draw.
    for section in ("parameters", "costs", *(["starts"] if len(sample.fit.starts) > 1 else [])):
        shown = re.search(rf'<section id="fit-1-{section}">(.*?)</section>', html, re.DOTALL).group(1)
        assert re.search(r'class="chart js-plotly-plot" data-figure="\d+"', shown), section
    for role in ("ratio", "coherence"):
        assert re.search(
            rf'class="[^"]*js-plotly-plot[^"]*" data-role="{role}"|data-role="{role}" class="[^"]*js-plotly-plot', html
        ), role


def test_the_controls_change_the_figures(tmp_path, arm):
    page = tmp_path / "report.html"
    page.write_text(render(arm.content), encoding="utf-8")
    script = """
      const plot = document.querySelector('.matrix .js-plotly-plot');
      const first = () => plot.data[1].y[5];
      const seen = [first()];
      document.querySelector('[aria-label="next configuration"]').click(); seen.push(first());
      document.querySelectorAll('.segments button')[1].click(); seen.push(first());
      const source = document.querySelector('select[aria-label="data"]');
      source.value = '1'; source.dispatchEvent(new Event('change')); seen.push(first());
      document.querySelectorAll('.cell')[9].click();
      document.querySelector('[data-move="1,0"]').click();
      seen.push(document.getElementById('enlarged-title').textContent);
      seen.push([...document.querySelectorAll('.modebar-btn')].map((one) => one.dataset.title).join());
      document.title = JSON.stringify(seen);
    """
    html, console = open_page(add_script(page, script), tmp_path, "--dump-dom", "--window-size=1400,1200")
    assert console == []
    seen = re.search(r"<title>\[(.*?)\]</title>", html).group(1)
    fit = arm.fit
    numbers = [float(value) for value in seen.split(",")[:4]]
    assert numbers == pytest.approx(expected_first_points(fit), abs=0.06)
    assert "axis_3 acceleration per axis_4 torque, configuration 1" in seen
    assert "Share" not in seen


def test_a_table_and_the_enlarged_element_are_chosen_from_alike(tmp_path, arm):
    page = tmp_path / "report.html"
    page.write_text(render(arm.content), encoding="utf-8")
    script = """
      const rows = [...document.querySelectorAll('#fit-1-resonances tr[data-choice]')];
      const shown = () => rows.filter((row) => !row.hidden).length;
      const select = document.querySelector('#fit-1-resonances select');
      const seen = [shown(), select.options.length];
      select.value = '2'; select.dispatchEvent(new Event('change')); seen.push(shown());
      select.value = '0'; select.dispatchEvent(new Event('change')); seen.push(shown());
      const configuration = document.querySelector('select[aria-label="configuration"]');
      document.querySelector('[aria-label="previous configuration"]').click(); seen.push(configuration.value);
      const source = document.querySelector('select[aria-label="data"]');
      source.value = '1'; source.dispatchEvent(new Event('change'));
      seen.push(configuration.value, configuration.options.length);
      document.querySelectorAll('.cell')[0].click();
      const press = (key) => document.getElementById('enlarged').dispatchEvent(new KeyboardEvent('keydown', { key }));
      press('ArrowUp'); press('ArrowLeft'); press('ArrowRight'); press('ArrowDown'); press('ArrowDown');
      const title = () => document.getElementById('enlarged-title').textContent.split(',')[0];
      seen.push(title());
      for (let times = 0; times < 9; times += 1) press('ArrowDown');
      seen.push(title(), document.querySelector('[data-move="1,0"]').disabled);
      document.title = JSON.stringify(seen);
    """
    html, console = open_page(add_script(page, script), tmp_path, "--dump-dom", "--window-size=1400,1200")
    assert console == []
    rows = [row.configuration for row in arm.fit.resonances]
    assert json.loads(re.search(r"<title>(\[.*?\])</title>", html).group(1)) == [
        len(rows), 4, rows.count(1), len(rows), "2", "0", 2,
        "axis_3 acceleration per axis_2 torque", "axis_6 acceleration per axis_2 torque", True,
    ]  # fmt: skip


CLIPPED = """
  window.addEventListener('load', () => setTimeout(() => {
    const box = (node) => node.getBoundingClientRect();
    const found = [];
    if (document.documentElement.scrollWidth > window.innerWidth) found.push('page');
    for (const node of document.querySelectorAll('.scroller')) {
      const wide = node.scrollWidth > node.clientWidth + 1;
      const clipped = WIDTH >= 800 || getComputedStyle(node).overflowX !== 'auto';
      if (wide && clipped) found.push(node.textContent.trim().slice(0, 40));
    }
    for (const plot of document.querySelectorAll('.js-plotly-plot')) {
      const own = box(plot);
      for (const text of own.width ? plot.querySelectorAll('svg text') : []) {
        const its = box(text);
        if (its.width && (its.left < own.left - 1 || its.right > own.right + 1)) found.push(text.textContent);
      }
    }
    const lines = [...document.querySelectorAll('.left-out')].filter((line) => !line.hidden);
    const left = lines.map((line) => line.textContent);
    parent.postMessage([window.innerWidth, found, left], '*');
  }, 1500));
"""
FRAME = """<body style="margin: 0"><iframe src="{page}" style="border: 0; width: {width}px; height: 1200px"></iframe>
<script>window.addEventListener('message', (event) => {{ document.title = JSON.stringify(event.data); }});</script>"""


@pytest.mark.parametrize("width", [1400, 800, 400])
def test_nothing_is_clipped_and_columns_that_leave_are_named(width, tmp_path, arm_content):
    page = tmp_path / "report.html"
    page.write_text(render(arm_content), encoding="utf-8")
    inner = add_script(page, CLIPPED.replace("WIDTH", str(width)))
    frame = tmp_path / "frame.html"
    frame.write_text(FRAME.format(page=inner.name, width=width), encoding="utf-8")
    html, console = open_page(
        frame, tmp_path, "--dump-dom", "--window-size=1500,1300", "--allow-file-access-from-files"
    )
    assert console == []
    seen, clipped, left = json.loads(re.search(r"<title>(\[.*?\])</title>", html).group(1))
    assert seen == width
    assert clipped == []
    # A table has room on a wide page; on the narrowest, columns leave.
    assert any(left) == (width < 800) or width == 800


def test_columns_that_left_come_back(tmp_path, arm_content):
    page = tmp_path / "report.html"
    page.write_text(render(arm_content), encoding="utf-8")
    script = """
      const table = document.querySelector('#fit-1-parameters table'), line = table.parentElement.nextElementSibling;
      const hidden = () => [...table.tHead.rows[0].cells].filter((cell) => cell.hidden).map((cell) => cell.textContent);
      const seen = [hidden().length > 0, hidden().every((head) => line.textContent.includes(head))];
      line.querySelector('button').click(); seen.push(hidden().length);
      line.querySelector('button').click(); seen.push(hidden().length > 0);
      document.title = JSON.stringify(seen);
    """
    html, console = open_page(add_script(page, script), tmp_path, "--dump-dom", "--window-size=500,1300")
    assert console == []
    assert json.loads(re.search(r"<title>(\[.*?\])</title>", html).group(1)) == [True, True, 0, True]


FRAMES = """<head><script>
  window.requestAnimationFrame = (draw) => window.setTimeout(() => draw(performance.now()), 16);
  window.cancelAnimationFrame = window.clearTimeout;
  window.IntersectionObserver = function (tell) { this.observe = () => tell([{ isIntersecting: true }]); };
</script>"""


def told_by(script, content, tmp_path, *flags):
    """What a script puts into the page's title as JSON."""
    page = tmp_path / "report.html"
    # In virtual time no frames are drawn, so that they are made here.
    page.write_text(render(content).replace("<head>", FRAMES), encoding="utf-8")
    later = f"window.setTimeout(() => {{ {script} }}, 300);"
    html, console = open_page(add_script(page, later), tmp_path, "--dump-dom", "--window-size=1400,1200", *flags)
    assert console == []
    return json.loads(unescape(re.search(r"<title>(\[.*?\])</title>", html, re.DOTALL).group(1)))


MODE = """
  const section = document.querySelector('#fit-1-modes');
  const select = (name) => section.querySelector(`select[aria-label="${name}"]`);
  const text = () => section.querySelector('.motion-text').textContent;
  const swing = () => section.querySelector('path.swing').getAttribute('d');
  const button = section.querySelector('.controls > button');
  const after = (ms) => new Promise((done) => window.setTimeout(done, ms));
"""


def test_an_arm_swings_stops_and_shows_the_mode_that_is_chosen(tmp_path, arm):
    script = """
      section.scrollIntoView();
      (async () => {
        await after(400);
        const moving = swing(); await after(300); const seen = [swing() !== moving];
        button.click(); await after(100);
        const still = swing(); await after(300); seen.push(swing() === still, button.textContent);
        seen.push(section.querySelector('path.reach').getAttribute('d') === still);
        seen.push(text());
        section.querySelector('[aria-label="next mode"]').click(); seen.push(text());
        section.querySelector('[aria-label="next configuration"]').click();
        seen.push(select('configuration').value, select('mode').value, text());
        button.click(); await after(200); const again = swing(); await after(300); seen.push(swing() !== again);
        document.title = JSON.stringify(seen);
      })();
    """
    moves, stops, label, outmost, first, second, configuration, mode, third, again = told_by(
        MODE + script, arm.content, tmp_path
    )
    assert (moves, stops, outmost, again) == (True, True, True, True)
    assert label.endswith("Play")
    assert (configuration, mode) == ("1", "0")
    modes = arm.fit.views.modes
    hertz = (modes[0].frequency_hz[0], modes[0].frequency_hz[1], modes[1].frequency_hz[0])
    for told, value in zip((first, second, third), hertz, strict=True):
        assert f"{value:.2f} Hz" in told


def test_an_arm_stands_still_where_motion_is_not_wanted(tmp_path, arm):
    script = """
      section.scrollIntoView();
      (async () => {
        await after(400); const still = swing(); await after(400);
        document.title = JSON.stringify([swing() === still, button.textContent]);
      })();
    """
    still, label = told_by(MODE + script, arm.content, tmp_path, "--force-prefers-reduced-motion")
    assert still
    assert label.endswith("Play")


def test_modes_and_resonances_lead_to_each_other(tmp_path, arm):
    script = """
      (async () => {
        const link = document.querySelectorAll('#fit-1-resonances td a')[4];
        link.click(); await after(200);
        const seen = [link.textContent, text()];
        const table = section.querySelector('table'), own = table.querySelectorAll('td:nth-child(2) a')[1];
        own.click(); await after(200); seen.push(own.textContent, text());
        const rows = document.querySelector('#fit-1-resonances select');
        rows.value = '3'; rows.dispatchEvent(new Event('change'));
        const back = table.querySelector('td:nth-child(4) a');
        back.click(); await after(200);
        const row = document.getElementById(back.hash.slice(1));
        seen.push(row.hidden, row.matches(':target'));
        document.title = JSON.stringify(seen);
      })();
    """
    hertz, shown, other, also, hidden, met = told_by(MODE + script, arm.content, tmp_path)
    assert f"{hertz} Hz" in shown
    assert f"{other} Hz" in also
    assert hertz != other
    assert (hidden, met) == (False, True)


def test_the_view_is_turned_by_dragging(tmp_path, arm):
    script = """
      const rest = () => section.querySelector('path.rest').getAttribute('d');
      const host = section.querySelector('.motions'), seen = [rest()];
      for (const [movementX, movementY] of [[60, 0], [0, 30]]) {
        host.dispatchEvent(new PointerEvent('pointermove', { buttons: 1, movementX, movementY }));
        seen.push(rest());
      }
      host.dispatchEvent(new PointerEvent('pointermove', { buttons: 0, movementX: 50 })); seen.push(rest());
      document.title = JSON.stringify([new Set(seen).size]);
    """
    assert told_by(MODE + script, arm.content, tmp_path) == [3]


def test_residuals_are_chosen_by_input_and_correlations_are_drawn(tmp_path, arm):
    script = """
      const residuals = document.querySelector('#fit-1-residuals');
      const shown = () => [...residuals.querySelectorAll('[data-option]:not([hidden]) .js-plotly-plot')];
      const seen = [shown().length, shown()[0].data[0].y[5]];
      residuals.querySelector('[aria-label="next input"]').click();
      seen.push(shown().length, shown()[0].data[0].y[5], shown()[0].querySelectorAll('.legendtext').length);
      const map = document.querySelector('#fit-1-correlation .js-plotly-plot');
      seen.push(map.data[0].z[0][1], map.data[0].customdata[0][1].join(), map.querySelectorAll('.hm image').length);
      document.title = JSON.stringify(seen);
    """
    count, pooled, again, own, names, r, pair, drawn = told_by(script, arm.content, tmp_path)
    relative = arm.fit.views.own.relative[:, 5, 0]
    assert (count, again) == (4, 4)
    assert pooled == pytest.approx(np.sqrt(np.mean(relative**2)), rel=1e-4)
    assert own == pytest.approx(np.sqrt(np.mean(relative[:, 0] ** 2)), rel=1e-4)
    assert names == 8  # six outputs, noise, resonances
    assert (r, pair, drawn) == (0.98, "gear_1.stiffness,gear_2.stiffness", 1)


@pytest.mark.parametrize("width", [1400, 800, 400])
def test_nothing_but_what_scrolls_is_wider_than_the_window(width, tmp_path, arm):
    script = """
      const beyond = (id) => [...document.querySelectorAll(`${id} *`)].filter((one) => !one.closest('.scroller > *')
        && one.getBoundingClientRect().right > window.innerWidth + 1).map((one) => one.outerHTML.slice(0, 90));
      const ids = ['#fit-1-modes', '#fit-1-residuals', '#fit-1-correlation'];
      parent.postMessage(JSON.stringify([window.innerWidth, ...ids.flatMap(beyond)]), '*');
    """
    page, frame = tmp_path / "report.html", tmp_path / "frame.html"
    page.write_text(render(arm.content), encoding="utf-8")
    inner = add_script(page, f"window.setTimeout(() => {{ {script} }}, 500);")
    # A window may not be as narrow as a phone; a frame may.
    frame.write_text(
        f"<iframe src='{inner.name}' style='width:{width}px;height:2000px;border:0'></iframe>"
        "<script>addEventListener('message', ({ data }) => { document.title = data; });</script>",
        encoding="utf-8",
    )
    html, console = open_page(frame, tmp_path, "--dump-dom", "--window-size=1500,1200")
    assert console == []
    assert json.loads(unescape(re.search(r"<title>(\[.*?\])</title>", html, re.DOTALL).group(1))) == [width]


def expected_first_points(fit):
    one, two, other = (
        fit.frf.response[0, 5, 0, 0],
        fit.frf.response[1, 5, 0, 0],
        fit.validation_frf.response[0, 5, 0, 0],
    )
    decibels = [20 * np.log10(abs(value)) for value in (one, two)]
    return [*decibels, *(np.rad2deg(np.angle(value)) for value in (two, other))]


@pytest.mark.parametrize(
    ("size", "scheme"), [("1400,2600", ""), ("1400,2600", DARK), ("500,2600", ""), ("500,2600", DARK)]
)
def test_screenshots(size, scheme, tmp_path, arm_content):
    page = tmp_path / "report.html"
    picture = tmp_path / "report.png"
    page.write_text(render(arm_content), encoding="utf-8")
    _, console = open_page(
        page, tmp_path, f"--window-size={size}", f"--screenshot={picture}", *([scheme] if scheme else [])
    )
    assert console == []
    assert picture.stat().st_size > 50_000


STEP_THROUGH = """
  const seen = [];
  const visible = () => [...document.querySelectorAll('.chart')].filter((one) => one.clientWidth > 0);
  const note = () => seen.push(visible().map((one) => ({
    first: one.data[0].y[0],
    names: one.data.filter((trace) => trace.showlegend !== false).map((trace) => trace.name),
    legend: one.querySelectorAll('.legend .traces').length,
    fits: one.querySelector('.main-svg').clientWidth <= one.clientWidth && one.scrollWidth <= one.clientWidth + 1,
  })));
  const pick = (label, value) => {
    const every = [...document.querySelectorAll(`select[aria-label="${label}"]`)];
    const select = every.find((one) => one.offsetParent !== null);
    select.value = String(value); select.dispatchEvent(new Event('change')); note();
  };
"""


def stepped(sections, tmp_path, picks, *arguments):
    """What is seen of figures at first and after each pick of a choice."""
    page = tmp_path / "report.html"
    page.write_text(render(ReportContent("t", Verdict("It holds.", "ok"), "", sections=sections)), encoding="utf-8")
    script = STEP_THROUGH + "note();" + "".join(f"pick({label!r}, {value});" for label, value in picks)
    html, console = open_page(
        add_script(page, f"{{{script} document.title = JSON.stringify(seen); }}"), tmp_path, "--dump-dom", *arguments
    )
    assert console == []
    return json.loads(html_text(re.search(r"<title>(\[.*?\])</title>", html, re.DOTALL).group(1)))


def html_text(text):
    return text.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")


def test_two_choices_are_combined_freely(tmp_path):
    names = [(motor, record) for motor in ("a", "b") for record in ("it's 1", '"2"', "3")]
    options = tuple(
        (each, (Figure("", "x", "y", (Curve("c", (0.0, 1.0), (float(place), 9.0)),), log_x=False, log_y=False),))
        for place, each in enumerate(names)
    )
    section = Section("s", parts=(Choices(("Motor", "Record"), options),))
    picks = [("record", 2), ("motor", 1), ("record", 1), ("motor", 0), ("record", 0)]
    seen = stepped((section,), tmp_path, picks)
    assert [[one["first"] for one in each] for each in seen] == [[0], [2], [5], [4], [1], [0]]


def test_combinations_must_be_complete():
    part = (Figure("", "x", "y", ()),)
    for names in ([("a", "1"), ("b", "2")], [("a", "1"), ("a", "1")], [("a",), ("b",)]):
        with pytest.raises(ValueError, match="each combination once"):
            Choices(("Motor", "Record"), tuple((each, part) for each in names))


@pytest.mark.parametrize("width", [1400, 800, 500])
def test_signals_and_limits_are_drawn_whatever_is_chosen(width, tmp_path):
    time = np.arange(2000) / 1000
    measured = np.stack([np.sin(30 * time), 2 + np.cos(50 * time)], axis=1)
    replays = [Replay(time, measured + shift, 0.9 * measured, 1.1 * measured) for shift in (0.0, 5.0)]
    kinds = ("axis_1", "axis_2"), ("rad/s^2",) * 2, ("acceleration",) * 2
    signals = signal_section([Signals(name, *kinds, found) for name, found in zip(("1", "2"), replays, strict=True)])
    hull = ((-3.0, -1.0), (3.0, -1.0), (3.0, 1.0), (-3.0, 1.0))
    rows = tuple(ReachedRow("day", motor, "speed", "rad/s", 1.0, 3.0, 2.0) for motor in ("axis_1", "axis_2"))
    planes = tuple(Plane("day", motor, hull, hull, 4.0, 2.0, 0.5) for motor in ("axis_1", "axis_2"))
    picks = [("output", 1), ("configuration", 1), ("output", 0)]
    seen = stepped((*signals, *reached_section(rows, planes)), tmp_path, picks, f"--window-size={width},2400")
    firsts = [0.0, 3.0, 8.0, 5.0]
    assert [each[0]["first"] for each in seen] == firsts
    for each in seen:
        assert [one["names"] for one in each] == [
            ["measured", "model"], ["measured less model"], ["all lines of the band", "measured", "model"],
            ["day", "day, samples"],
        ]  # fmt: skip
        assert all(one["fits"] and one["legend"] == len(one["names"]) for one in each)

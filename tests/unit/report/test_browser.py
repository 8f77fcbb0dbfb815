"""The page in a real browser: no console error, figures drawn, screenshots to look at."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from robid.report.page import render

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
    for section in ("parameters", "costs", "starts"):
        shown = re.search(rf'<section id="fit-1-{section}">(.*?)</section>', html, re.DOTALL).group(1)
        assert re.search(r'class="chart js-plotly-plot" data-figure="\d"', shown), section
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

"""The site builds without a warning, its links lead somewhere, and it needs no network."""

import os
import re
import shutil
import subprocess
import sys
from urllib.parse import quote

import pytest

from message_codes import codes_written
from settings_tables import ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    here = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(build, cwd=ROOT, env=here, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return folder


def test_no_page_fetches_anything(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 60
    fetched = re.compile(
        r'<(?:script|img|iframe)[^>]* src="(?:https?:)?//|<link[^>]* rel="(?:stylesheet|icon)"[^>]*https?:'
    )
    assert [page.name for page in pages if fetched.search(page.read_text(encoding="utf-8"))] == []


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
@pytest.mark.parametrize(
    ("term", "page"),
    [
        ("frequency response", "concepts/frequency-responses.html"),
        ("payload", "concepts/rigid-fit.html"),
        ("load_robot", "reference/python.html"),
        ("S380", "reference/messages.html"),
    ],
)
def test_the_search_finds_the_terms_of_the_field_in_a_page_opened_from_a_folder(site, term, page):
    address = f"{(site / 'index.html').as_uri()}?q={quote(term)}"
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=30000", "--dump-dom")
    shown = subprocess.run(["chromium", *flags, address], capture_output=True, text=True, check=True, timeout=120)
    found = re.findall(r'href="([^"#?]*)[^"]*" class="md-search-result__link', shown.stdout)
    assert (site / page).as_uri() in found


def test_every_code_of_a_message_has_an_anchor(site):
    page = (site / "reference/messages.html").read_text(encoding="utf-8")
    anchors = {one.upper() for one in re.findall(r'<h3 id="(\w+)"', page)}
    assert set(codes_written()) <= anchors

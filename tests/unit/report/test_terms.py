"""Terms of a page: each link leads somewhere, each term is a label that the code writes, and texts are escaped."""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import words
from robid.report.page import Headline, KeyNumber, ReportContent, Verdict, render
from robid.report.section import Notes, Section, Table
from robid.report.terms import Terms

ROOT = Path(__file__).parents[3]
TERMS = YAML(typ="safe").load((ROOT / "robid/explanations/terms.yaml").read_text("utf-8"))
MINUS = "\N{MINUS SIGN}"


@pytest.mark.parametrize("which", ["arm_content", "bench_content"])
def test_every_link_of_a_page_leads_to_a_place_on_it(which, request):
    page = render(request.getfixturevalue(which))
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    links = set(re.findall(r'href="#([^"]+)"', page))
    # The moving arm is set to a mode by the mode's own address.
    modes = set(re.findall(r'"anchor":"([^"]+)"', page))
    assert links <= set(ids) | modes
    assert {link for link in links if link.startswith("term-")}


def test_each_label_is_one_that_the_code_writes(arm_content):
    folders = [ROOT / "robid" / name for name in ("report", "models", "fleet")]
    files = [path for folder in folders for path in folder.rglob("*.*") if path.suffix in {".py", ".j2"}]
    source = "".join(path.read_text("utf-8") for path in files).replace("\\N{MINUS SIGN}", MINUS)
    page = render(arm_content)
    labels = [name for entry in TERMS.values() for name in entry["names"]]
    assert len(labels) == len(set(labels))
    written = (any(text in source for text in (f'"{name}"', f'"{name} [')) or f">{name}</a>" in page for name in labels)
    assert [name for name, known in zip(labels, written, strict=True) if not known] == []


@pytest.mark.parametrize("key", TERMS)
def test_a_term_is_explained_in_short_sentences_of_the_field(key):
    entry = TERMS[key]
    assert (ROOT / "docs" / entry["read"]).exists()
    assert [one for one in words.sentences(entry["means"]) if words.words(one) > words.LONGEST] == []
    assert words.uses(entry["means"]) == []


def test_codes_link_to_their_explanation_and_text_is_escaped():
    section = Section("Notes", "", (Notes(("D001 is <b>bold</b> and `x < y`", "Q999 is no code")),), "notes")
    headline = Headline("", (KeyNumber("Condition number", "3", "of 5 %"),))
    page = render(ReportContent("t", Verdict("5 % off", "ok"), "r", headlines=(headline,), sections=(section,)))
    assert '<a class="term" href="#message-D001">D001</a> is &lt;b&gt;bold' in page
    assert "<code>x &lt; y</code>" in page
    assert '<dt id="message-D001">' in page
    assert "message-Q999" not in page
    assert "5\N{NO-BREAK SPACE}% off" in page
    assert '<a class="term" href="#term-condition">Condition number</a>' in page


def test_a_page_without_terms_has_no_section_of_them():
    table = Table(("Something", "else"), (("a", "b"),))
    page = render(ReportContent("t", Verdict("fine", "ok"), "r", sections=(Section("Own", "", (table,), "own"),)))
    assert 'id="terms"' not in page
    assert Terms(table).every == ()

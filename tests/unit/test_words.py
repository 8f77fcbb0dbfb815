"""Pages are plain technical English: short sentences, and none of the words that the glossary retires."""

import pytest

import words
from settings_tables import ROOT

LONG_SHARE = 0.05  # of sentences over words.LONGEST words
PAGES = words.documents()


def test_few_sentences_of_the_pages_are_long():
    long, every = zip(*(words.long_sentences(page) for page in PAGES), strict=True)
    assert sum(map(len, long)) <= LONG_SHARE * sum(every), [one for page in long for one in page]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_use_no_retired_word(page):
    assert words.uses(words.prose(page)) == []


def test_messages_help_and_pages_of_runs_use_no_retired_word():
    assert [(place, text) for place, text in words.shown_texts() if words.uses(text)] == []


def test_few_sentences_of_messages_help_and_pages_of_runs_are_long():
    every = [one for _, text in words.shown_texts() for one in words.sentences(text)]
    long = [one for one in every if words.words(one) > words.LONGEST]
    assert len(long) <= LONG_SHARE * len(every), long


def test_sentences_and_retired_words_are_counted(tmp_path):
    page = tmp_path / "page.md"
    thirty, more = ("word " * count for count in (words.LONGEST, words.LONGEST + 1))
    page.write_text(
        f"# Title\nA row {thirty[10:]}. The {more}.\n\n```\n{more}\n```\n\n| {more} | told |\n", encoding="utf-8"
    )
    found, count = words.long_sentences(page)
    assert (len(found), count) == (2, 3)
    assert words.uses(words.prose(page)) == ["told"]
    assert words.uses("A joint is held at rest; a value is held.") == ["held"]
    assert words.uses("`held` is code, [a link](held.md) has a target") == []

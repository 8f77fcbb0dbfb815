"""Sentences wrap for a terminal; words, commands, numbers with their units stay whole."""

import io
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robid.report.wrapping import WIDEST, terminal_width, wrap

WORDS = st.lists(st.text("abc/._-[]", min_size=1, max_size=30), min_size=1, max_size=40)


@given(WORDS, st.integers(40, 300), st.integers(0, 6))
def test_every_word_is_whole_and_every_line_short(words, width, indent):
    lines = wrap(" " * indent + " ".join(words), width).split("\n")
    assert " ".join(lines).split() == words
    assert max(map(len, lines)) <= min(width, WIDEST)
    assert all(line.startswith(" " * (indent + 2)) for line in lines[1:])
    assert len(lines[0]) - len(lines[0].lstrip()) == indent


@given(WORDS)
def test_without_a_terminal_a_line_is_a_line(words):
    text = "\n".join(words)
    assert wrap(text, None) == text


def test_lines_of_a_message_wrap_each_for_itself():
    text = "robid: " + "word " * 30 + "\n  remedy: " + "other " * 30
    lines = wrap(text, 60).split("\n")
    remedy = next(place for place, line in enumerate(lines) if line.startswith("  remedy"))
    assert all(line.startswith("  word") for line in lines[1:remedy])
    assert all(line.startswith("    other") for line in lines[remedy + 1 :])


@pytest.mark.parametrize("before", range(60))
def test_a_command_and_a_number_with_its_unit_stay_on_one_line(before):
    told = "x" * before + " `robid run configs/kr300.yaml` within ±6.0 % (23.3 s) of 1.5 kN m"
    lines = wrap(told, 48).split("\n")
    for whole in ("`robid run configs/kr300.yaml`", "±6.0 %", "(23.3 s)", "1.5 kN"):
        assert any(whole in line for line in lines), whole


def test_a_command_longer_than_a_line_breaks_between_its_words():
    lines = wrap("`robid simulate-or-acquire configs/kr300.yaml --campaign estimation`", 40).split("\n")
    assert max(map(len, lines)) <= 40


class _Stream(io.StringIO):
    def __init__(self, descriptor=None):
        super().__init__()
        self.descriptor = descriptor

    def isatty(self):
        return True

    def fileno(self):
        return super().fileno() if self.descriptor is None else self.descriptor


def test_the_width_is_what_is_stated_else_the_terminal_s_own(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(os, "get_terminal_size", lambda descriptor: os.terminal_size((descriptor, 24)))
    assert terminal_width(io.StringIO()) is None
    assert terminal_width(_Stream(63)) == 63
    assert terminal_width(_Stream(0)) == 80  # some terminals say that they have none
    assert terminal_width(_Stream()) == 80
    monkeypatch.setenv("COLUMNS", "71")
    assert terminal_width(_Stream(63)) == 71
    monkeypatch.setenv("COLUMNS", "many")
    assert terminal_width(_Stream(63)) == 63

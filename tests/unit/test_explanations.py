"""Every code of a message is explained, and `robid explain` tells it."""

import json
import sys
from dataclasses import fields

import pytest
from ruamel.yaml import YAML

import words
from message_codes import codes_written
from robid.cli import run_command
from robid.commands.explain import GRADES, LETTERS, Explanation, codes_explained, explanation, read_grades, read_texts
from robid.results.grade import WORDS

PARTS = ("means", "why", "do")
LONGEST = 600


@pytest.fixture
def told(capsys):
    def run(*arguments):
        code = run_command(["explain", *arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


@pytest.mark.parametrize("letter", LETTERS)
def test_each_code_of_the_package_is_explained_and_no_other(letter):
    explained = codes_explained(read_texts(letter))
    written = {code for code in codes_written() if code[0] == letter}
    assert {"unexplained": written - {*explained}, "not there": {*explained} - written} == {
        "unexplained": set(),
        "not there": set(),
    }
    assert explained == sorted(set(explained))


@pytest.mark.parametrize("letter", LETTERS)
def test_each_explanation_has_three_short_texts(letter):
    text = read_texts(letter)
    entries = YAML(typ="safe", pure=True).load(text)
    assert [*entries] == codes_explained(text)
    for code, entry in entries.items():
        assert tuple(entry) == PARTS, code
        assert all(isinstance(one, str) and one.strip() and "{}" not in one for one in entry.values()), code
        assert sum(map(len, entry.values())) < LONGEST, code
        assert len(set(entry.values())) == len(PARTS), code


@pytest.mark.parametrize("letter", LETTERS)
def test_explanations_have_short_sentences_and_no_retired_word(letter):
    entries = YAML(typ="safe", pure=True).load(read_texts(letter))
    texts = [(code, text) for code, entry in entries.items() for text in entry.values()]
    assert [(code, found) for code, text in texts if (found := words.uses(text))] == []
    assert [
        (code, one) for code, text in texts for one in words.sentences(text) if words.words(one) > words.LONGEST
    ] == []


def test_one_code_is_read_as_in_the_whole_file():
    text = read_texts("S")
    entries = YAML(typ="safe", pure=True).load(text)
    first, *_, last = entries
    for code in (first, "S380", last):
        found = explanation(code, text)
        assert {part: getattr(found, part) for part in PARTS} == entries[code]


def test_codes_are_explained_in_the_order_asked_once_each_and_small_letters_will_do(told):
    code, out, err = told("s380", "S007", "S380", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)["explanations"]
    assert [one["code"] for one in found] == ["S380", "S007"]
    assert all([*one] == [field.name for field in fields(Explanation)] for one in found)
    assert {(one["kind"], one["exit_code"]) for one in found} == {("settings", 2)}


@pytest.mark.parametrize(("columns", "widest"), [(60, 60), (300, 100)])
def test_lines_end_with_the_terminal(told, monkeypatch, columns, widest):
    monkeypatch.setenv("COLUMNS", str(columns))
    code, out, _ = told("S326")
    assert code == 0
    assert widest - 20 < max(map(len, out.splitlines())) <= widest
    wanted = explanation("S326", read_texts("S"))
    assert " ".join(wanted.means.split()[:3]) in out


@pytest.mark.parametrize("wrong", ["S999", "X001", "S38", "nothing", ""])
def test_a_code_that_is_not_there_is_refused_even_beside_one_that_is(told, wrong):
    code, out, err = told("S380", wrong)
    assert (code, out) == (2, "")
    assert "S530" in err


def test_a_code_that_is_not_there_brings_near_ones(told):
    _, _, err = told("S3800")
    assert "S380" in err.partition("remedy")[2]


def test_without_a_code_letters_are_told(told):
    code, out, _ = told()
    assert code == 0
    assert [line[:1] for line in out.splitlines()[1:] if not line.startswith(" ")] == [*LETTERS]
    assert [*json.loads(told("--json")[1])["letters"]] == [*LETTERS]


@pytest.mark.parametrize(("terminal", "hinted"), [(True, True), (False, False)])
def test_an_error_on_a_terminal_says_where_more_is(capsys, monkeypatch, terminal, hinted):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    assert run_command(["status", "nowhere.yaml"]) == 2
    assert ("robid explain S333" in capsys.readouterr().err) is hinted


def test_each_grade_is_explained_in_the_words_that_are_printed():
    assert [WORDS[value].split(",")[0] for value in sorted(WORDS, reverse=True)] == [*read_grades()] == [*GRADES]
    for grade, one in read_grades().items():
        assert len({one.means, one.why, one.do}) == 3, grade
        for text in (one.means, one.why, one.do):
            assert not words.uses(text), grade
            assert all(words.words(each) <= words.LONGEST for each in words.sentences(text)), grade


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        (["grades"], ["trust", "predicts", "do not use"]),
        (["trust"], ["trust"]),
        (["do not use"], ["do not use"]),
        (["do", "not", "use"], ["do not use"]),
        (["Predicts", "F020"], ["predicts", "F020"]),
    ],
)
def test_grades_are_asked_for_as_codes_are(told, asked, found):
    code, out, _ = told(*asked, "--json")
    assert code == 0
    assert [one["code"] for one in json.loads(out)["explanations"]] == found


@pytest.mark.parametrize("columns", [40, 80])
@pytest.mark.parametrize("asked", [[], ["grades"], ["S007"]])
def test_lines_are_no_longer_than_the_terminal(told, monkeypatch, columns, asked):
    monkeypatch.setenv("COLUMNS", str(columns))
    _, out, _ = told(*asked)
    assert max(map(len, out.splitlines())) <= columns

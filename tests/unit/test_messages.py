"""Every message that a user can cause has a code that no other one has, at the place where it is written."""

import ast

import pytest

from message_codes import CODED, codes_written, literals, sources
from robid.errors import ArtifactError, BackendError, DataError, SettingsError, codes_in
from robid.results.finding import CAUSES

LETTERS = {"SettingsError": "S", "ArtifactError": "A", "DataError": "D", "BackendError": "B", "WorkerError": "B"}


def test_no_two_messages_share_a_code():
    found = codes_written()
    assert len(found) > 600
    assert not [code for code, count in found.items() if count > 1]


def test_every_error_that_is_raised_with_its_own_words_has_a_code_of_its_letter():
    wrong = []
    for file, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in LETTERS and node.args:
                texts = dict(literals(node.args[0]))
                own = texts.get(node.args[0])
                match = own and CODED.match(own)
                if own is not None and (not match or match[1][0] != LETTERS[node.func.id]):
                    wrong.append((file.name, node.lineno, own))
    assert not wrong


def test_every_cause_has_a_code():
    assert all(len(codes_in(words)) == 1 and codes_in(words)[0][0] == "F" for words in CAUSES.values())


@pytest.mark.parametrize("kind", [SettingsError, ArtifactError, DataError, BackendError])
def test_a_message_says_where_what_and_what_to_do(kind):
    error = kind("S001 it is wrong; D002 so is that", where="bench.yaml:3", remedy="correct A003 in `S004`")
    assert str(error) == "bench.yaml:3: S001 it is wrong; D002 so is that\n  remedy: correct A003 in `S004`"
    assert error.codes == ("S001", "D002", "A003")


def test_names_and_paths_are_no_codes():
    assert codes_in("`S001` of logs/D002/A003.h5, S004.x and S0051 (F006)") == ("F006",)

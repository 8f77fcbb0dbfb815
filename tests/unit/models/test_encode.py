import csv
import io

import numpy as np
import pytest

from robid.models.encode import encode_csv, encode_table

FORMULAS = ["=1+1", "+cmd", "-cmd", "@SUM(A1)", "\t=1", "\r=1", "\n=1"]


def read(data):
    return list(csv.reader(io.StringIO(data.decode(), newline="")))


@pytest.mark.parametrize("text", FORMULAS)
def test_no_text_of_a_table_is_a_formula_and_numbers_stay(text):
    rows = read(encode_csv(("name", text), [[text, -1.5], ["spring", np.float64(-2.0)]]))
    assert rows == [["name", f"'{text}"], [f"'{text}", "-1.5"], ["spring", "-2.0"]]


@pytest.mark.parametrize("text", ["=1+1", "a,b", 'a"b'])
def test_a_column_of_numbers_is_one_whatever_its_name(text):
    heads, values = read(encode_table((), ("t", text), np.array([[0.0, -1.5]])))
    assert heads == ["t", f"'{text}" if text.startswith("=") else text]
    assert [float(value) for value in values] == [0.0, -1.5]

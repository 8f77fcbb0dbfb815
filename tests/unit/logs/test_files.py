"""Files of logs: structures and matrices of MAT files, and tables."""

import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError
from robid.logs.files import find_variable, load_variables


def test_fields_of_structures_are_named_as_in_matlab(tmp_path):
    channels = np.zeros((1, 2), [("Name", object), ("Data", object)])
    channels[0, 0], channels[0, 1] = ("angle", np.arange(5.0)), ("speed", np.arange(5.0) * 2)
    cells = np.empty((1, 2), object)
    cells[0] = [np.ones(4), np.zeros(4)]
    savemat(tmp_path / "log.mat", {"meas": {"X": {"Data": np.arange(5.0) / 10}, "Y": channels}, "c": cells})
    variables = load_variables(tmp_path / "log.mat")
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "meas.Y(2).Data")), np.arange(5.0) * 2)
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "meas(1).X(1).Data")), np.arange(5.0) / 10)
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "c{1}")), np.ones(4))
    for name in ("meas.Y(3).Data", "meas.Y.Data", "meas", "c"):
        with pytest.raises(KeyError):
            find_variable(variables, name)


def test_columns_of_matrices_have_numbers(tmp_path):
    matrix = np.arange(12.0).reshape(4, 3)
    savemat(tmp_path / "log.mat", {"rec": {"tau": matrix}, "row": np.arange(3.0)})
    variables = load_variables(tmp_path / "log.mat")
    np.testing.assert_array_equal(find_variable(variables, "rec.tau(:,3)"), matrix[:, 2])
    np.testing.assert_array_equal(find_variable(variables, "rec.tau(:, 1)"), matrix[:, 0])
    for name in ("rec.tau(:,4)", "rec.tau(:,0)", "tau(:,1)"):
        with pytest.raises(KeyError):
            find_variable(variables, name)


@pytest.mark.parametrize(
    "text",
    [
        "# a comment\n t , speed [rad/s]\n0,1e-3\n1,-2\n",
        '"t";"speed [rad/s]"\n0;0,001\n\n1;-2,0\n',
        "t\tspeed [rad/s]\r\n0\t0.001\r\n1\t-2\r\n",
        "\ufefft,speed [rad/s]\n0,0.001\n1,-2",
    ],
)
def test_tables_of_several_dialects(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    variables = load_variables(path, "csv")
    assert list(variables) == ["t", "speed [rad/s]"]
    np.testing.assert_array_equal(find_variable(variables, "speed [rad/s]"), [0.001, -2])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no table"),
        ("t,q\n", "no table"),
        ("t,q\n0,1\n1\n", "line 3: The table is broken: 1 values for 2 columns"),
        ("t,q\n0,1\n1,two\n", "line 3: The table is broken: `two` is no number"),
        ("t,q\n0,1,2\n1,2,3\n", "line 2: The table is broken: 3 values for 2 columns"),
        ("t,t\n0,1\n", "occur twice: t"),
        (b"\xff\xfe\x00\x01", "cannot be read as text"),
    ],
)
def test_broken_tables_are_located(tmp_path, text, words):
    path = tmp_path / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(DataError) as caught:
        load_variables(path, "csv")
    assert words in str(caught.value)
    assert "log.csv" in caught.value.where
    assert caught.value.remedy

"""Tables of text whose head says more than names: exports of TwinCAT 3 Scope, LabVIEW measurement files."""

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable

Q, W = [0.5, 1.5, -2.0, 3.25], [10.0, 20.0]
HEAD = "Name;Scope\nFile;C:\\x.csv\nStarttime of export;132959733843760000;2. Mai 2022\nEndtime of export;1329597\n\n"


def load(folder, text, names=None, name="log.csv"):
    path = folder / name
    path.write_text(text)
    return load_variables(path, None, names)


def scope(head, rows, mark=";"):
    return (HEAD + head + "\n" + "\n".join(rows) + "\n").replace(";", mark)


BOTH = "Name;q;Name;w\nSampleTime[ms];1;SampleTime[ms];2\n"
PLAIN = "Name;q;Name;w\nOffset;0;Offset;0\n"
POINTS = ["0;0.5;0;10", "1;1.5;2;20", "2;-2;;", "3;3.25;;"]
TICKS = ["00;0.5;132959733843760000;10", "10;1.5;132959733843780000;20", "20;-2;;", "30;3.25;;"]
SCOPES = {
    "a time each": scope(
        f"{BOTH}Unit;rad (Angle);Unit;(None)\n", ["0;0,5;0;10", "1;1,5;2;20", "2;-2;;", "3;3,25;;", "EOF"]
    ),
    "shorter rows": scope(BOTH, ["0;0,5;0;10", "1;1,5;2;20", "2;-2", "3;3,25"]),
    "slow ones first": scope("Name;w;Name;q\n", ["0;10;0;0,5", "2;20;1;1,5", ";;2;-2", ";;3;3,25"]),
    "filled": scope(BOTH, ["0;0,5;0;10", "1;1,5;0;10", "2;-2;2;20", "3;3,25;2;20"]),
    "tabs": scope(PLAIN, POINTS, "\t"),
    "colons": scope(PLAIN, POINTS, ":"),
    "commas": scope(f"{PLAIN}SampleTime[ms];0,2;SampleTime[ms];2\n", POINTS, ","),
    "whole moments": scope(PLAIN, [f"1329597338437{int(row[:2]) // 10 + 6}0000{row[2:]}" for row in TICKS]),
    "two groups": scope("Name;q;v;Name;w;u\n", ["0;0,5;7;0;10;1", "1;1,5;7;2;20;1", "2;-2;7", "3;3,25;7"]),
}


@pytest.mark.parametrize("layout", SCOPES)
def test_each_group_of_a_scope_has_its_own_time(tmp_path, layout):
    for names in (None, ["q", "w", "q.time", "w.time"], ["q"], ["w.time"]):
        found = load(tmp_path, SCOPES[layout], names)
        wanted = {"q": Q, "w": W, "q.time": [0, 1, 2, 3], "w.time": [0, 2]}
        assert set(names or wanted) <= set(found)
        for name in names or wanted:
            np.testing.assert_allclose(found[name], wanted[name], atol=1.7e-3 * (layout == "whole moments"))
        assert {found.units[one] for one in ("q.time", "w.time")} == {"ms"}


def test_times_of_a_scope_may_be_dates(tmp_path):
    rows = [f"02.05.2022 15:56:24,{i:03d};{q};02.05.2022 15:56:24,{i:03d};7" for i, q in enumerate(Q)]
    found = load(tmp_path, scope("Name;q;Name;w\nSampleTime[ms];1;SampleTime[ms];1\n", rows))
    np.testing.assert_array_equal(found["q"], Q)
    np.testing.assert_allclose(found["w.time"], 1e-3 * np.arange(4))
    assert found.units["w.time"] == "s"


def test_lines_of_a_scope_may_end_with_a_separator(tmp_path):
    head = "Name;q;Name;w;\nSampleTime[ms];1;SampleTime[ms];1;\nUnit;rad (Angle);Unit;Nm (Torque);\n"
    found = load(tmp_path, scope(head, ["0;0,5;0;7;", "1;1,5;1;8;", "2;-2;2;9;", "3;3,25;3;9;"]))
    np.testing.assert_array_equal(found["q"], Q)
    assert (found.units["q"], found.units["w"]) == ("rad", "Nm")


def test_every_channel_of_a_group_has_the_time_of_the_group(tmp_path):
    for names in (None, ["v.time", "u.time", "u"]):
        found = load(tmp_path, SCOPES["two groups"], names)
        np.testing.assert_array_equal(found["v.time"], [0, 1, 2, 3])
        np.testing.assert_array_equal(found["u.time"], [0, 2])
        assert (found["u"].tolist(), found.units["u.time"]) == ([1, 1], "ms")
    assert "u.time" in load(tmp_path, SCOPES["two groups"], ["u"]).sizes


@pytest.mark.parametrize("times", ["Name;q;v\nSampleTime[ms];0,5;0,5\nUnit;rad (Angle);Nm (Torque)\n"])
def test_a_scope_without_times_has_the_steps_of_its_head(tmp_path, times):
    found = load(tmp_path, scope(times, ["0,5;7", "1,5;8", "-2;9", "3,25;9"]))
    np.testing.assert_allclose(found["time"], 5e-4 * np.arange(4))
    np.testing.assert_array_equal(find_variable(found, "q"), Q)
    assert found.units == {"q": "rad", "v": "Nm", "time": "s"}
    found = load(tmp_path, scope(times.replace("0,5;0,5", "0,5;1"), ["0,5;7", "1,5;8", "-2;", "3,25"]), ["v.time", "v"])
    np.testing.assert_allclose(found["v.time"], [0, 1e-3])
    np.testing.assert_array_equal(found["v"], [7, 8])


def test_a_scope_with_one_time_calls_it_so(tmp_path):
    found = load(tmp_path, scope("Name;q;v\nSampleTime[ms];1;1\n", ["0;0,5;7", "1;1,5;8", "2;-2;9", "3;3,25;9"]))
    np.testing.assert_array_equal(found["time"], [0, 1, 2, 3])
    assert (list(found), found.units) == (["time", "q", "v"], {"time": "ms"})


def lvm(x_columns, names, rows, told="", *, mark="Tab", decimal="."):
    head = f"LabVIEW Measurement;\nSeparator;{mark}\nDecimal_Separator;{decimal}\n"
    head += f"Multi_Headings;No\nX_Columns;{x_columns}\n"
    head += "Date;2022/05/02\nTime;15:56:24.376\n***End_of_Header***;\n;\n"
    text = head + told + "***End_of_Header***;\n" + names + "\n" + "\n".join(rows) + "\n"
    return text.replace(";", {"Tab": "\t", "Comma": ",", "Semicolon": ";"}[mark]).replace("~", decimal)


def told(*columns, samples=("4", "4"), time="15:56:24~376", x0="0~0E+0", step="0~00025"):
    parts = {
        "Channels": "2",
        "Samples": samples,
        "Date": ["2022/05/02"] * 2,
        "Time": [time] * 2,
        "Y_Unit_Label": ["Nm", "rad"],
    }
    parts |= {"X_Dimension": ["Time"] * 2, "X0": [x0] * 2, "Delta_X": [step] * 2}
    return "".join(f"{key};{(';;' if 'multi' in columns else ';').join(cells)};\n" for key, cells in parts.items())


LAYOUTS = {
    "one": ("One", "X_Value;q;w;Comment", ["0~0;0~5;10", "0~00025;1~5;20;late", "5~0E-4;-2;30", "7~5E-4;3~25;40"]),
    "no": ("No", "X_Value;q;w;Comment", [";0~5;10", ";1~5;20;late", ";-2;30", ";3~25;40"]),
    "no, and no column": ("No", "X_Value;q;w;Comment", ["0~5;10", "1~5;20", "-2;30", "3~25;40"]),
    "multi": (
        "Multi",
        "X_Value;q;X_Value;w;Comment",
        ["0;0~5;0;10", "25E-5;1~5;25E-5;20", "50E-5;-2;50E-5;30", "75E-5;3~25;75E-5;40"],
    ),
}


@pytest.mark.parametrize(("mark", "decimal"), [("Tab", "."), ("Tab", ","), ("Comma", "."), ("Semicolon", ",")])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_columns_of_labview_have_their_times(tmp_path, layout, mark, decimal):
    columns, names, rows = LAYOUTS[layout]
    text = lvm(columns, names, rows, told(layout), mark=mark, decimal=decimal)
    found = load(tmp_path, text, name="log.lvm")
    time = {"one": "X_Value", "multi": "w.time"}.get(layout, "time")
    np.testing.assert_array_equal(found["q"], Q)
    np.testing.assert_array_equal(found["w"], [10, 20, 30, 40])
    np.testing.assert_allclose(found[time], 0.00025 * np.arange(4), atol=1e-15)
    assert (found.units["q"], found.units["w"], found.units[time]) == ("Nm", "rad", "s")
    np.testing.assert_array_equal(load(tmp_path, text, [time], name="log.lvm")[time], found[time])


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("time", "begin"), [("15:56:24~377", 0.001), ("15:56:24~4", 0.001), ("15:56:25~376", 1.0), ("", None)]
)
def test_segments_of_labview_follow_each_other(tmp_path, layout, time, begin):
    columns, names, rows = LAYOUTS[layout]
    second = [*told(layout, time=time).splitlines(), "***End_of_Header***;", names, *rows]
    found = load(tmp_path, lvm(columns, names, [*rows, "", *second], told(layout)), name="log.lvm")
    np.testing.assert_array_equal(found["q"], [*Q, *Q])
    clock = found[{"one": "X_Value", "multi": "q.time"}.get(layout, "time")]
    steps = 0.00025 * np.arange(4)
    np.testing.assert_allclose(clock, [*steps, *(steps + (begin or 0))], atol=1e-12)


def test_channels_of_labview_may_have_lengths_of_their_own(tmp_path):
    rows = ["0;0.5;0;10", "0.1;1.5;0.2;20", "0.2;-2;;", "0.3;3.25;;"]
    found = load(tmp_path, lvm("Multi", "X_Value;q;X_Value;w", rows, told("multi", samples=("4", "2"))))
    np.testing.assert_array_equal(found["w.time"], [0, 0.2])
    assert (found["q"].tolist(), found["w"].tolist()) == (Q, W)
    rows = [";0.5;10", ";1.5;20", ";-2;", ";3.25;"]
    found = load(tmp_path, lvm("No", "X_Value;q;w", rows, told(samples=("4", "2"))), ["w"])
    assert found["w"].tolist() == W


def test_what_is_missing_at_the_end_of_a_labview_file_is_told(tmp_path):
    columns, names, rows = LAYOUTS["one"]
    found = load(tmp_path, lvm(columns, names, rows[:3], told()))
    assert "3 of the 4 rows" in found.found.damage.what
    with pytest.raises(DataError, match="line"):
        load(tmp_path, lvm(columns, names, [*rows, "1.0"], told()))


def test_a_channel_of_labview_without_a_name_has_a_number(tmp_path):
    columns, _, rows = LAYOUTS["one"]
    found = load(tmp_path, lvm(columns, "X_Value;;w;Comment;", rows, told()))
    assert (found["2"].tolist(), found["w"].tolist()) == (Q, [10, 20, 30, 40])


def test_special_blocks_of_labview_are_passed_over(tmp_path):
    columns, names, rows = LAYOUTS["one"]
    block = "***Start_Special***;\nmade by;me\n3;4\n***End_Special***;\n"
    np.testing.assert_array_equal(load(tmp_path, lvm(columns, names, rows, block + told()))["q"], Q)

"""Tables in terminals of any width: whole columns go, never a digit."""

import re
from dataclasses import replace

import pytest
from rich.console import Console, Group
from rich.text import Text

from robid.models.elastic.page.report import fit_tables
from robid.pipeline.terminal import section_table
from robid.report.parameter_section import parameter_table
from robid.report.terminal_table import Column, Footnotes, TerminalTable, folded
from terminals import left_out, numbers, screen, widest

WIDTHS = (80, 100, 120)


def long_names(estimates):
    """Seven axes with names as vendors give them, everything known of each that may be."""
    springs = [row for row in estimates.rows if row.kind == "stiffness"][:7]
    rows = [
        replace(
            row,
            name=f"manipulator_left_joint_{number}_reducer",
            physical=1.01 * row.estimate,
            effective=(row.estimate, row.lower, row.upper),
        )
        for number, row in enumerate(springs, 1)
    ]
    return replace(estimates, rows=tuple(rows))


def made(*leaves, rows=3):
    """A table of numbers that say which row and column they are of."""
    columns = [
        Column("name", numbers=False),
        *(Column(f"head{place}", leaves=at) for place, at in enumerate(leaves, 1)),
    ]
    table = TerminalTable(columns, elsewhere="on the page")
    for row in range(rows):
        table.add(f"row_{row}", *(f"{row}.{place:07d}" for place in range(1, len(columns))))
    return table


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("named", [lambda estimates: estimates, long_names])
def test_parameters_fit_with_whole_numbers_and_say_which_columns_are_missing(arm, named, width):
    shown = parameter_table(named(arm.fit.estimates))
    text, whole = screen(shown, width), screen(shown, 400)
    assert widest(text) <= width
    assert numbers(text) <= numbers(whole)
    gone, where, needed = left_out(text)
    assert not left_out(whole)[0]
    heads = [column.head for column in shown.renderables[0].columns]
    assert set(gone) <= set(heads)
    for place, head in enumerate(heads):
        cells = [row[place].plain.strip() for row in shown.renderables[0].rows if len(row) == len(heads)]
        if head not in gone and place > 0:
            assert all(re.search(rf"(^| ){re.escape(cell)}( |$)", text, re.MULTILINE) for cell in cells), head
    assert "page" in where or not gone
    if gone:
        assert not left_out(screen(shown, needed))[0]
        assert left_out(screen(shown, needed - 1))[0]
    assert {"parameter", "estimate", "95 % interval", "unit"}.isdisjoint(gone)


def test_the_least_important_column_goes_first_and_the_first_one_never():
    shown = made(0, 3, 1, 2)
    gone = [left_out(screen(shown, width))[0] for width in range(70, 18, -1)]
    order = [["head3"], ["head3", "head4"], ["head2", "head3", "head4"]]
    assert [each for each, before in zip(gone[1:], gone, strict=False) if each != before] == order


def test_a_head_wraps_before_a_column_goes():
    columns = [Column("name", numbers=False), Column("share of the limit", leaves=1)]
    table = TerminalTable(columns)
    table.add("arm", "5")
    assert not left_out(screen(table, 13))[0]
    assert left_out(screen(table, 8))[0] == ["share of the limit"]


def test_names_wrap_between_their_parts_when_no_column_can_go():
    table = TerminalTable([Column("name", numbers=False), Column("value")])
    table.add("  gear_12.stiffness", "1.2345678")
    lines = screen(table, 23).splitlines()
    assert widest("\n".join(lines)) <= 23
    assert sum("1.2345678" in line for line in lines) == 1
    assert any("12." in line for line in lines)
    assert "".join(" ".join(lines[1:]).replace("1.2345678", "").split()) == "gear_12.stiffness"


@pytest.mark.parametrize("width", [1, 5, 20, 40])
def test_a_narrow_terminal_gets_a_line_for_each_cell(arm, width):
    for shown in fit_tables(arm.fit):
        text = screen(shown, width)
        assert "gear" in "".join(text.split())
        if width >= 20:
            assert widest(Group(*shown.renderables[:1]) and screen(shown.renderables[0], width)) <= width
    assert numbers(screen(made(0, 0, 0), 16)) <= numbers(screen(made(0, 0, 0), 400))


def test_a_pipe_gets_everything_on_a_line_a_row():
    table = made(*range(40), rows=2)
    lines = screen(table, 200, is_terminal=False).splitlines()
    assert len(lines) == 3
    assert all(f"1.{place:07d}" in lines[2] for place in range(1, 41))


def test_a_note_hangs_by_two_in_a_terminal_and_is_one_line_in_a_pipe():
    note = " ".join(f"word{number}" for number in range(60))
    shown = Footnotes([note, "short"])
    lines = screen(shown, 300).splitlines()
    assert widest("\n".join(lines)) <= 100
    assert [line[:2] == "  " for line in lines] == [False, *[True] * (len(lines) - 2), False]
    assert screen(shown, 200, is_terminal=False).splitlines() == [note, "short"]


def test_a_title_stands_across_all_columns_and_brackets_are_text():
    table = TerminalTable([Column("name", numbers=False), Column("value [rad]")], title="peaks [bold]")
    table.add(Text("A title that is longer than both columns", "bold"))
    table.add("x[red]", "1")
    text = screen(table, 60)
    assert "peaks [bold]" in text
    assert "A title that is longer than both columns" in text
    assert "x[red]" in text
    assert "value [rad]" in text


def test_wide_letters_count_twice():
    table = TerminalTable([Column("name", numbers=False), Column("value")])
    table.add("関節一二三", "1.5")
    table.add("abcdef", "2.5")
    lines = screen(table, 60).splitlines()
    assert {widest(line) for line in lines} == {10 + 2 + len("value")}


def test_what_is_folded_keeps_every_letter_and_numbers_whole():
    for width in range(7, 40):
        lines = folded("  axis_12.gear_345 over noise/model 67.89 %", width)
        assert "".join("".join(lines).split()) == "axis_12.gear_345overnoise/model67.89%"
        assert all(any(number in line for line in lines) for number in ("12", "345"))


@pytest.mark.parametrize("width", WIDTHS)
def test_a_table_of_a_page_keeps_its_first_columns_and_wraps_its_sentences(width):
    columns = ("Case", "What was found", *(f"Figure {number}" for number in range(1, 13)))
    sentence = "least squares is off by 12.5 % where the instruments are not, as theory says"
    rows = [(f"case_{row}", sentence, *(f"{row}.{place:05d} %" for place in range(12))) for row in range(4)]
    shown = section_table("A table", columns, rows, "on the page")
    text = screen(shown, width)
    assert widest(text) <= width
    assert numbers(text) <= numbers(screen(shown, 400))
    gone, where, _ = left_out(text)
    assert gone == list(columns[-len(gone) :])
    assert len(gone) < 12
    assert "page" in where
    assert all(f"{row}.00000 %" in text for row in range(4))


def test_what_is_said_of_a_column_goes_with_it():
    columns = [Column("name", numbers=False), Column("value"), Column("nominal", leaves=1, note="a: assumed")]
    table = TerminalTable(columns)
    table.add("gear_of_the_base", "1234567.8", "a 1234567.8")
    wide, narrow = Console(width=60, force_terminal=True), Console(width=30, force_terminal=True)
    for console, told in ((wide, True), (narrow, False)):
        with console.capture() as captured:
            console.print(table)
        assert ("a: assumed" in captured.get()) is told

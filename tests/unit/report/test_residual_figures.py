"""Residuals over frequency on a page: what is pooled, on which scales, and what marks resonances."""

from dataclasses import replace

import numpy as np

from robid.report.residuals import ResidualData, residual_section
from robid.report.section import Figure
from robid.results.line_residuals import LineResiduals

HZ = np.array([1.0, 2.0, 4.0])


def data(name="own", scale=1.0, marks=(), n_out=2, noise_share=0.5):
    shape = (2, 3, n_out, 2)
    relative = scale * np.ones(shape) * np.array([0.01, 0.03])  # of the first input and of the second
    relative[1] *= np.sqrt(3)
    lines = LineResiduals(relative, 0.5 * relative, 10 * relative, np.full(shape, noise_share))
    outputs = tuple(f"axis_{number + 1}" for number in range(n_out))
    return ResidualData(name, HZ, outputs, ("axis_1", "axis_2"), lines, marks)


def options_of(*every):
    (section,) = residual_section(every, "")
    (choice,) = section.parts
    return {name: parts[0].parts for name, parts in choice.options}


def test_inputs_are_pooled_or_chosen_and_configurations_are_pooled():
    options = options_of(data())
    assert list(options) == ["all inputs", "axis_1", "axis_2"]
    # Root of the mean of 1 and 3 times each input's square.
    for name, square in (("all inputs", (0.01**2 + 0.03**2) / 2), ("axis_1", 0.01**2), ("axis_2", 0.03**2)):
        relative, deviations = options[name]
        np.testing.assert_allclose(relative.curves[0].y, np.sqrt(2 * square))
        np.testing.assert_allclose(deviations.curves[1].y, 10 * np.sqrt(2 * square))
        assert [curve.name for curve in relative.curves] == ["axis_1", "axis_2", "noise alone"]
        np.testing.assert_allclose(relative.curves[2].y, 0.5 * np.sqrt(2 * square))


def test_noise_alone_is_pooled_over_the_outputs():
    plain = data()
    lines = replace(plain.lines, noise=np.broadcast_to(np.array([1.0, 7.0])[:, None], (2, 3, 2, 2)))
    relative, _ = options_of(replace(plain, lines=lines))["axis_1"]
    np.testing.assert_allclose(relative.curves[2].y, 5.0)


def test_the_expected_level_is_one_and_in_sight():
    relative, deviations = options_of(data())["axis_1"]
    assert relative.lines == ()
    (line,) = deviations.lines
    assert (line.along, line.at) == ("y", 1.0)
    assert deviations.y_range[0] < 1 < deviations.y_range[1]


def test_own_data_and_new_ones_share_their_scales():
    figures = options_of(data("own"), data("new", 5.0))["all inputs"]
    assert len(figures) == 4
    assert all(isinstance(figure, Figure) for figure in figures)
    assert figures[0].y_range == figures[2].y_range
    assert figures[1].y_range == figures[3].y_range
    highest = max(max(curve.y) for figure in figures[::2] for curve in figure.curves)
    assert figures[0].y_range[1] > highest


def test_resonances_are_marked_within_the_picture_and_of_the_outputs_shown():
    marks = (("axis_2", 2.5, "here"), ("elsewhere", 3.0, "not here"))
    for figure in options_of(data(marks=marks))["all inputs"]:
        rug = figure.curves[-1]
        assert (rug.x, rug.texts) == ((2.5,), ("here",))
        assert figure.y_range[0] < rug.y[0] < figure.y_range[1]


def test_noise_that_is_all_of_a_deviation_is_not_drawn_again():
    names = [curve.name for curve in options_of(data(noise_share=1.0))["axis_1"][1].curves]
    assert names == ["axis_1", "axis_2"]


def test_many_outputs_are_shown_in_several_pictures():
    options = options_of(data(n_out=13))
    assert len(options) == 6
    pictures = [options[f"all inputs, axis_{span}"][0] for span in ("1 to axis_10", "11 to axis_13")]
    shown = [curve.name for picture in pictures for curve in picture.curves if curve.name.startswith("axis")]
    assert shown == [f"axis_{number}" for number in range(1, 14)]
    looks = [(curve.shade, curve.dashed) for curve in pictures[0].curves if curve.name.startswith("axis")]
    assert len(set(looks)) == len(looks)


def test_nothing_is_shown_of_nothing():
    assert residual_section((), "") == ()

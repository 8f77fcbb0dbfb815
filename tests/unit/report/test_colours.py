"""Colours of data are told apart by everybody, and those of a state mean nothing else.

Dichromacy: Machado, Oliveira and Fernandes, "A Physiologically-based Model for Simulation of Color Vision Deficiency",
IEEE Transactions on Visualization and Computer Graphics, vol. 15, no. 6, 2009, severity 1.0.
"""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

import robid.report

TEMPLATES = Path(robid.report.__file__).parent / "templates"
VISION = {
    "full": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = [0.95047, 1.0, 1.08883]
DATA = ("measured", "model", "odd", "even", "other", "panel")
STATES = ("ok", "warn", "bad")
FAR = 20  # CIE 1976 difference; 2.3 is just noticeable


def themes():
    css = (TEMPLATES / "page.css").read_text()
    blocks = re.findall(r":root \{(.*?)\n\s*\}", css, re.DOTALL)
    return [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", block)) for block in blocks]


def lightness_and_hue(colour, vision):
    """CIE L*a*b* of an sRGB colour as somebody sees it."""
    coded = np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)]) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    relative = np.array(TO_XYZ) @ np.clip(np.array(VISION[vision]) @ linear, 0, 1) / WHITE
    x, y, z = np.where(relative > 0.008856, np.cbrt(relative), 7.787 * relative + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def distance(one, other, vision):
    return np.linalg.norm(lightness_and_hue(one, vision) - lightness_and_hue(other, vision))


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("theme", [0, 1])
def test_colours_of_data_are_told_apart(theme, vision):
    colours = themes()[theme]
    for one, other in itertools.combinations(DATA, 2):
        assert distance(colours[one], colours[other], vision) > FAR, (one, other)


@pytest.mark.parametrize("theme", [0, 1])
def test_a_warning_has_a_colour_of_its_own(theme):
    colours = themes()[theme]
    for kind in ("odd", "even", "measured"):
        assert distance(colours["warn"], colours[kind], "full") > FAR


@pytest.mark.parametrize("path", sorted(TEMPLATES.glob("*.j[s2]*")), ids=lambda path: path.name)
def test_colours_stand_in_the_style_sheet_alone(path):
    text = re.sub(r"&#\d+;", "", path.read_text())
    assert not re.search(r"#[0-9a-fA-F]{3,8}\b(?!\-)|\brgba?\(|\bhsl\((?!\$)|Viridis", text)


@pytest.mark.parametrize("path", sorted(TEMPLATES.glob("*.js")), ids=lambda path: path.name)
def test_no_curve_has_the_colour_of_a_state(path):
    assert not re.search(rf'"({"|".join(STATES)})"|--({"|".join(STATES)})\b', path.read_text())

"""Modes on the page of a fit: the moving arm, which springs the energy of each is in, and links to resonances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.frf.frf import Frf
from robid.models.elastic.judge.modes import ArmModes
from robid.models.elastic.page.gather import ResonanceRow
from robid.report.charts import Motion, MovingArms, Triples, configuration_label
from robid.report.numbers import MISSING, number_of, percent, significant
from robid.report.section import Cell, ColumnStyle, Row, Section, Table

_SHARE = 0.12  # Largest displacement of a picture over the arm's length
_TURN = 0.6  # Largest displacement of the ends of the tool's axes against the tool, over their length
_LEAST = 0.05  # Share of the energy from which a sentence names a spring
_MOST = 4  # Springs that it names
_VISIBLE = 0.005  # Share of the energy from which the table writes it
_SAME = 1e-6  # Relative distance of frequencies of one mode
_LEAD = (
    "What moves at each of the fitted model's natural frequencies, motors free, in and a little around the measured"
    " band, and which springs store the energy: what a mode depends on, and what stiffening or damping would change."
)
_FIGURE = (
    "All modes are drawn equally slowly, enlarged and without their decay: the largest displacement is"
    f" {100 * _SHARE:.0f} % of the arm's length, or less where the tool mostly turns. Points that are not in phase pass"
    " their rest one after the other. The short strokes at the end are two axes of the tool, which turn with it. Drag"
    " to turn."
)
_TABLE = (
    "Share of each spring in the elastic energy, mean over a cycle; a dash is less than half a per cent. Frequency and"
    " damping ratio are those of the fitted model's poles. Seen by: motors whose own response shows it as a resonance,"
    " with a link to its row."
)


def mode_anchor(fit: str, configuration: int, mode: int) -> str:
    """Names a mode in the page's address."""
    return f"{fit}-mode-{configuration + 1}-{mode + 1}"


def resonance_anchor(fit: str, row: int) -> str:
    """Names a row of the resonances in the page's address."""
    return f"{fit}-resonance-{row + 1}"


def mode_of(row: ResonanceRow, modes: Sequence[ArmModes]) -> int | None:
    """Index of the mode, in its configuration, that a resonance is of; None for none."""
    if row.kind != "resonance" or row.mode_hz is None or row.configuration >= len(modes):
        return None
    near = np.abs(modes[row.configuration].frequency_hz / row.mode_hz - 1)
    return int(np.argmin(near)) if near.size and near.min() < _SAME else None


def mode_section(
    modes: Sequence[ArmModes], springs: Sequence[str], frf: Frf, fit: str, rows: Sequence[ResonanceRow]
) -> tuple[Section, ...]:
    """Lays out the modes of a fit, with links to its resonances; nothing without any mode."""
    if not any(each.frequency_hz.size for each in modes):
        return ()
    labels = [configuration_label(frf, index) for index in range(len(modes))]
    arms = MovingArms(
        title="",
        names=tuple(labels),
        points=tuple(_triples(each.points_m) for each in modes),
        motions=tuple(_motions(each, springs, fit, place) for place, each in enumerate(modes)),
        caption=_FIGURE,
    )
    parts = arms, _table(modes, springs, labels, fit, rows)
    return (Section("Modes of the arm", _LEAD, parts, "modes"),)


def mode_sentence(hertz: float, damping: float, shares: FloatArray, springs: Sequence[str]) -> str:
    """Says which springs a mode's elastic energy is in, the most first."""
    order = np.argsort(-shares, kind="stable")
    named = [index for index in order.tolist() if shares[index] >= _LEAST][:_MOST]
    told = [f"{percent(float(shares[index]))} {springs[index]}" for index in named]
    rest = 1 - float(shares[named].sum())
    told += [f"{percent(rest)} in others"] if rest >= _VISIBLE else []
    at = f"Mode at {significant(hertz, 4)} Hz, damping ratio {percent(damping)}"
    return f"{at}; elastic energy: {', '.join(told)}."


def _motions(modes: ArmModes, springs: Sequence[str], fit: str, configuration: int) -> tuple[Motion, ...]:
    drawn = modes.shape * picture_scale(modes)[:, None, None]
    columns = modes.frequency_hz.tolist(), modes.damping.tolist(), modes.energy
    # Re(u exp(j p)) = Re(u) cos p - Im(u) sin p.
    return tuple(
        Motion(
            name=f"{number_of(mode)}: {significant(hertz, 4)} Hz",
            anchor=mode_anchor(fit, configuration, mode),
            text=mode_sentence(hertz, damping, shares, springs),
            cosine=_triples(drawn[mode].real),
            sine=_triples(-drawn[mode].imag),
        )
        for mode, (hertz, damping, shares) in enumerate(zip(*columns, strict=True))
    )


def picture_scale(modes: ArmModes) -> FloatArray:
    """Returns the size (n_mode,) of the largest displacement in a picture of each mode [m]."""
    *_, tool, first, second = modes.points_m
    lever = float(min(np.linalg.norm(first - tool), np.linalg.norm(second - tool)))
    # Where the tool mostly turns, its axes would be stretched beyond recognition by what moves an arm visibly.
    turned = np.linalg.norm(modes.shape[:, -2:] - modes.shape[:, -3:-2], axis=2).max(axis=1)
    most = np.divide(_TURN * lever, turned, out=np.full(turned.shape, np.inf), where=turned > 0)
    return np.asarray(np.minimum(_SHARE * modes.length_m or np.inf, most))


def _triples(points: FloatArray) -> Triples:
    return tuple((float(x), float(y), float(z)) for x, y, z in np.round(points, 4) + 0.0)


def _table(
    modes: Sequence[ArmModes],
    springs: Sequence[str],
    labels: Sequence[str],
    fit: str,
    resonances: Sequence[ResonanceRow],
) -> Table:
    seen: dict[tuple[int, int], list[int]] = {}
    for row, resonance in enumerate(resonances):
        mode = mode_of(resonance, modes)
        if mode is not None:
            seen.setdefault((resonance.configuration, mode), []).append(row)
    rows = []
    for place, each in enumerate(modes):
        for mode, (hertz, damping) in enumerate(zip(each.frequency_hz.tolist(), each.damping.tolist(), strict=True)):
            cells = (
                number_of(place),
                Cell(significant(hertz, 4), link=f"#{mode_anchor(fit, place, mode)}"),
                percent(damping),
                _seen_by(seen.get((place, mode), []), resonances, fit),
                *(f"{100 * share:.0f} %" if share >= _VISIBLE else MISSING for share in each.energy[mode].tolist()),
            )
            rows.append(Row(cells, choice=labels[place]))
    shares: list[ColumnStyle] = ["number" for _ in springs]
    styles: tuple[ColumnStyle, ...] = ("text", "strong", "number", "text", *shares)
    heads = ("Conf.", "Mode [Hz]", "Damping", "Seen by", *springs)
    # Springs that no mode moves much leave a narrow page first.
    most = np.max([share for each in modes for share in each.energy], axis=0)
    leaves = tuple(springs[index] for index in np.argsort(most, kind="stable").tolist())
    return Table(heads, tuple(rows), caption=_TABLE, styles=styles, choice="Configuration", leaves=leaves, fit="tall")


def _seen_by(rows: Sequence[int], resonances: Sequence[ResonanceRow], fit: str) -> str | Cell:
    """The motors whose own response shows a mode, with a link to the first row of them."""
    channels = dict.fromkeys(resonances[row].channel for row in rows)
    return Cell(", ".join(channels), link=f"#{resonance_anchor(fit, rows[0])}") if rows else MISSING

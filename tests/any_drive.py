"""Logs of one drive in the layouts of common tools, by the steady state of two inertias, which is known exactly."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from any_log import MIDNIGHT, STAMPS
from any_log_text import Text
from log_files import WRITERS

STEP_S, PERIOD = 1e-3, 500
LINES = np.arange(5, 100)
NAMES = {
    "English": ("drive torque", "motor angle", "load angle"),
    "short": ("tau", "theta_motor", "theta_load"),
    "German": ("Drehmoment", "Winkel Motor", "Winkel Abtrieb"),
}
TORQUE = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "kN m": 1e3}
ANGLE = {"rad": 1.0, "deg": np.pi / 180, "mrad": 1e-3, "°": np.pi / 180}
NAMED = {"brackets": "{} [{}]", "parentheses": "{} ({})", "underscore": "{}_{}"}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6}


def response() -> np.ndarray:
    """Accelerations of motor and load for a torque at the lines (n_line, 2)."""
    omega = 2 * np.pi * LINES / (PERIOD * STEP_S)
    spring = 300.0 + 0.2j * omega
    load = spring / (spring - 5e-3 * omega**2)
    motor = 1 / (spring * (1 - load) - 5e-3 * omega**2)
    return -np.stack([motor, motor * load], axis=1) * omega[:, None] ** 2


@dataclass(frozen=True)
class Drive:
    """What is chosen of a log.

    Attributes:
        layout: A format of `WRITERS`, `text`, or a structure of Simulink or ControlDesk.
        text: How a table of text is written.
        words: The language of the names.
        named: How a unit stands behind a name.
        torque: Unit of the torque.
        angle: Unit of the angles.
        time: Unit of the time, `` where there is none.
        stamp: How the time is written as date, or nothing.
        offset: What the angles begin at, in turns.
        turned: Whether the load counts the other way.
        wraps: Whether angles begin anew after a turn.
        shift: Samples by which the log begins later in the period.
        periods: Periods of the log, beside a part of one.
        order: Order of the columns.
    """

    layout: str = "text"
    text: Text = field(default_factory=Text)
    words: str = "short"
    named: str = "brackets"
    torque: str = "N m"
    angle: str = "rad"
    time: str = "s"
    stamp: str = ""
    offset: float = 0.0
    turned: bool = False
    wraps: bool = False
    shift: int = 0
    periods: int = 5
    order: tuple[int, ...] = (0, 1, 2, 3)

    def write(self, folder: Path) -> Path:
        """Writes the log."""
        names = dict(zip(("tau", "motor", "load"), NAMES[self.words], strict=True))
        units = {"tau": self.torque, "motor": self.angle, "load": self.angle}
        signals = self._signals()
        if self.layout in ("Simulink", "ControlDesk"):
            return _write_structure(self.layout, folder, signals, names, units)
        table = {self._name(name, units[key]): signals[key] for key, name in names.items()}
        if self.time:
            table = {self._name("time", "" if self.stamp else self.time): self._time(len(signals["tau"])), **table}
            table = {name: table[name] for name in [list(table)[at] for at in self.order]}
        if self.layout == "text":
            path = folder / "log.csv"
            self.text.write(path, table, {})
            return path
        writer, file = WRITERS[self.layout]
        if self.layout.startswith("mat"):
            table = {name.translate(str.maketrans(" [", "__", "]()°")): values for name, values in table.items()}
        if self.layout in ("hdf5", "tdms", "csv LabVIEW"):
            stated = {self._name(names[key], unit): unit for key, unit in units.items()}
            stated[self._name("time", self.time)] = self.time
            return Path(writer(folder / file, table, stated)[0])
        return Path(writer(folder / file, table)[0])

    def _name(self, name: str, unit: str) -> str:
        if self.named == "underscore":
            unit = unit.replace(" ", "").replace("°", "deg")
        return NAMED[self.named].format(name, unit) if unit else name

    def _signals(self) -> dict[str, np.ndarray]:
        """Torque and angles in their units."""
        omega = 2 * np.pi * LINES / (PERIOD * STEP_S)
        waves = np.concatenate([np.ones((len(LINES), 1)), -response() / omega[:, None] ** 2], axis=1)
        spectrum = np.zeros((PERIOD // 2 + 1, 3), complex)
        spectrum[LINES] = waves * np.exp(-1j * np.pi * (LINES - 5) ** 2 / len(LINES))[:, None]
        period = np.fft.irfft(spectrum, PERIOD, axis=0) * PERIOD / 2
        tau, motor, load = np.roll(np.tile(period, (self.periods + 1, 1)), -self.shift, axis=0)[self.shift // 3 :].T
        angles = [motor, -load if self.turned else load]
        turn = 2 * np.pi / ANGLE[self.angle]
        angles = [each / ANGLE[self.angle] + self.offset * turn for each in angles]
        if self.wraps:
            angles = [each % turn for each in angles]
        return {"tau": tau / TORQUE[self.torque], "motor": angles[0], "load": angles[1]}

    def _time(self, n_sample: int) -> Any:
        seconds = STEP_S * np.arange(n_sample)
        if self.stamp:
            # Midnight lies in the middle.
            begin = MIDNIGHT - timedelta(seconds=STEP_S * (n_sample // 2))
            return [(begin + timedelta(seconds=round(s, 6))).strftime(STAMPS[self.stamp]) for s in seconds.tolist()]
        return seconds * TIMES[self.time]


def _write_structure(
    layout: str, folder: Path, signals: dict[str, np.ndarray], names: dict[str, str], units: dict[str, str]
) -> Path:
    """Writes what Simulink saves as a structure with time, or ControlDesk as a recording."""
    time = STEP_S * np.arange(len(signals["tau"]))
    if layout == "Simulink":
        kinds = [("values", object), ("dimensions", object), ("label", object)]
        listed = [(signals[key][:, None], 1.0, f"{name} [{units[key]}]") for key, name in names.items()]
        log = {"time": time[:, None], "signals": np.array(listed, kinds), "blockName": "model/To Workspace"}
        savemat(folder / "log.mat", {"out": log})
    else:
        kinds = [("Name", object), ("Data", object), ("Unit", object), ("XIndex", object)]
        listed = [(f'"Model Root"/{name}/Out1', signals[key][None], units[key], 1.0) for key, name in names.items()]
        axis = {"Name": "", "Data": time[None], "Raster": "HostService"}
        savemat(folder / "log.mat", {"rec1_001": {"X": axis, "Y": np.array(listed, kinds)}})
    return folder / "log.mat"

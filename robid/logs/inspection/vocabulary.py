"""Words in names of signals, English, German and French: what they say of quantity, side and command."""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from typing import Literal, TypeAlias

Role: TypeAlias = Literal[
    "torque", "current", "force", "voltage", "angle", "position", "speed", "acceleration", "other", ""
]
"""What a signal is; `other` is none of a drive's, an empty one is unknown."""

Side: TypeAlias = Literal["motor", "arm", "tool", ""]

_WORDS: dict[Role, str] = {
    "torque": "torque torques tau trq tq tor moment momente mom moments drehmoment effort efforts couple couples",
    "current": "current currents cur curr iq isq amp amps ampere strom courant",
    "force": "force forces thrust kraft",
    "voltage": "voltage volt volts uq ud vq vd spannung tension",
    "angle": "angle angles ang theta phi rotation winkel drehwinkel",
    "position": "position positions pos posn enc encoder lage displacement disp travel slide qpos weg stellung"
    " deplacement",
    "speed": "speed speeds vel velocity velocities omega qd dq qdot dqdt rpm drehzahl geschwindigkeit qvel tacho"
    " tachometer vitesse vit",
    "acceleration": "acceleration accelerations acc accel qdd ddq qddot beschleunigung qacc",
    "other": "temperature temp status state flag mode counter count index seq error err warning vdc bus dclink id sec"
    " secs nanosec nanosecs digital din dout msr mask valid quality humidity frame temperatur fehler zustand erreur",
}
ROLES = {word: role for role, words in _WORDS.items() for word in words.split()}

LETTERS: dict[str, Role] = {
    **{"q": "angle", "x": "position", "y": "position", "z": "position", "v": "speed", "w": "speed", "n": "speed"},
    **{"a": "acceleration", "m": "torque", "f": "force", "i": "current", "c": "current", "u": "voltage"},
}
"""What single letters of a name are mostly used for."""

COMMANDED = frozenset(
    (
        *("ref", "reference", "refs", "cmd", "command", "commanded", "set", "setpoint", "sp", "soll", "sollwert"),
        *("des", "desired", "target", "tgt", "demand", "dem", "dmd", "input", "goal", "planned", "vorgabe"),
        *("consigne", "cons", "commande"),
    )
)
MEASURED = frozenset(
    (
        *("act", "actual", "meas", "measured", "ist", "istwert", "fb", "feedback", "ad", "adx", "sensor"),
        *("mess", "messwert", "gemessen", "mesure", "mesuree", "mes", "reel", "reelle"),
    )
)
SIDES: dict[str, Side] = {
    **dict.fromkeys(("motor", "mot", "mtr", "rotor", "servo", "moteur", "antrieb"), "motor"),
    **dict.fromkeys(("load", "link", "arm", "output", "secondary", "second", "table", "last", "abtrieb"), "arm"),
    **dict.fromkeys(("lastseitig", "abtriebsseitig", "charge", "bras"), "arm"),
    **dict.fromkeys(("tcp", "tool", "flange", "tip", "tracker", "ee"), "tool"),
}
_LINKING = frozenset(("joint", "axis", "achse", "achs", "gelenk", "wert", "value", "signal", "side", "seite", "axe"))
"""Words that say nothing of a signal, but are parts of longer ones."""

_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SHORTEST = 3
"""Letters of the shortest word that is looked for in a longer one."""


def tokens(name: str) -> tuple[str, ...]:
    """Returns the words and numbers of a name in lower case, without accents, compound words in their parts."""
    return tuple(part for one in _TOKEN.findall(without_accents(name)) for part in _parts(one.lower()))


def without_accents(text: str) -> str:
    """Returns a text with plain letters."""
    apart = unicodedata.normalize("NFD", text.replace("ß", "ss"))
    return "".join(one for one in apart if not unicodedata.combining(one))


def is_known(word: str) -> bool:
    """Whether a word says something of quantity, side or command."""
    return word in _known()


@cache
def _known() -> frozenset[str]:
    return frozenset((*ROLES, *COMMANDED, *MEASURED, *SIDES, *_LINKING))


@cache
def _parts(word: str) -> tuple[str, ...]:
    """Known words that a word is made of, as in `Motordrehzahl` or `Antriebsmoment`; itself where it is not."""
    return (word,) if word in _known() else _split(word) or (word,)


def _split(word: str) -> tuple[str, ...]:
    for end in range(len(word) - _SHORTEST, _SHORTEST - 1, -1):
        if word[:end] not in _known():
            continue
        for rest in (word[end:], word[end + 1 :] if word[end] == "s" else ""):
            found = (rest,) if rest in _known() and len(rest) >= _SHORTEST else _split(rest) if rest else ()
            if found:
                return (word[:end], *found)
    return ()

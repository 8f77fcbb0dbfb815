"""Words and units in names of signals, English, German and French: what they say of quantity, side and command."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias

from robid.signals.quantities import UNITS

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
    "speed": "speed speeds vel velocity velocities omega qd dq qdot dqdt dtheta thetadot dphi phidot rpm drehzahl"
    " geschwindigkeit qvel tacho tachometer vitesse vit",
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
ESTIMATED = frozenset(
    (
        "ext",
        "external",
        "extern",
        "externe",
        "hat",
        "est",
        "estimated",
        "estimate",
        "observer",
        "disturbance",
        "residual",
    )
)
"""Words of torques that a controller's observer makes beside those that drive."""
SIDES: dict[str, Side] = {
    **dict.fromkeys(("motor", "mot", "mtr", "rotor", "servo", "moteur", "antrieb"), "motor"),
    **dict.fromkeys(("load", "link", "arm", "output", "secondary", "second", "table", "last", "abtrieb"), "arm"),
    **dict.fromkeys(("lastseitig", "abtriebsseitig", "charge", "bras"), "arm"),
    **dict.fromkeys(("tcp", "tool", "flange", "tip", "tracker", "ee"), "tool"),
}
# Words that say nothing of a signal, but are parts of longer ones
_LINKING = frozenset(("joint", "axis", "achse", "achs", "gelenk", "wert", "value", "signal", "side", "seite", "axe"))
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SHORTEST = 3  # letters of the shortest word that is looked for in a longer one


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


CONVERTED: dict[str, tuple[str, float]] = {
    "N cm": ("mN m", 10.0),
    "cN m": ("mN m", 10.0),
    "daN m": ("N m", 10.0),
    "lbf in": ("N m", 0.1129848290276167),
    "lbf ft": ("N m", 1.3558179483314004),
    "ozf in": ("mN m", 7.061551814226044),
    "kgf m": ("N m", 9.80665),
    "kgf cm": ("mN m", 98.0665),
    "daN": ("N", 10.0),
    "mN": ("N", 1e-3),
    "uA": ("mA", 1e-3),
    "cm": ("mm", 10.0),
    "in": ("mm", 25.4),
    "arcmin": ("deg", 1 / 60),
    "arcsec": ("deg", 1 / 3600),
    "gon": ("deg", 0.9),
    "turn/s": ("rpm", 60.0),
    "krpm": ("rpm", 1000.0),
    "mrad/s": ("rad/s", 1e-3),
    "cm/s": ("mm/s", 10.0),
    "m/min": ("m/s", 1 / 60),
    "mm/min": ("mm/s", 1 / 60),
    "um/s": ("mm/s", 1e-3),
    "g": ("m/s^2", 9.80665),
    "nanometre": ("um", 1e-3),
}
"""Units that a mapping does not know, as one that it knows and a factor, both exact."""

_SPELLINGS = {
    **dict.fromkeys(("newtonmeter", "newtonmetre"), "N m"),
    **dict.fromkeys(("°", "degree", "degrees", "grad", "degre", "degres"), "deg"),
    **dict.fromkeys(("°/s", "degrees/s", "grad/s", "dps"), "deg/s"),
    **dict.fromkeys(("°/s^2", "grad/s^2"), "deg/s^2"),
    **dict.fromkeys(
        ("1/min", "u/min", "r/min", "rev/min", "tr/min", "turn/min", "/min", "min^-1", "min-1", "upm"), "rpm"
    ),
    **dict.fromkeys(("amp", "amps", "ampere", "arms", "apk"), "A"),
    **dict.fromkeys(("rev", "revs", "turns", "revolution", "revolutions", "u", "r", "tr", "tour", "tours"), "turn"),
    **dict.fromkeys(("rev/s", "rps", "u/s", "r/s", "tr/s"), "turn/s"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("radians/s",), "rad/s"),
    **dict.fromkeys(("count", "counts", "cnt", "cnts", "inc", "incr", "increments", "inkr", "ticks", "lsb"), "counts"),
    **dict.fromkeys(("counts/s", "inc/s", "cnt/s", "ticks/s", "inkr/s"), "counts/s"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek"), "s"),
    **dict.fromkeys(("ms", "msec"), "ms"),
    **dict.fromkeys(("us", "usec"), "us"),
    **dict.fromkeys(("ns", "nsec"), "ns"),
    **dict.fromkeys(("v", "volt", "volts"), "V"),
    **dict.fromkeys(("°c", "degc", "k"), "degC"),
    **dict.fromkeys(("lbin", "lbfin", "inlb", "inlbf"), "lbf in"),
    **dict.fromkeys(("lbft", "lbfft", "ftlb", "ftlbf"), "lbf ft"),
    **dict.fromkeys(("ozin", "ozfin", "inoz"), "ozf in"),
    **dict.fromkeys(("inch", "inches", '"'), "in"),
}
_SPELLINGS = {**{name.replace(" ", "").lower(): name for name in (*CONVERTED, *UNITS)}, **_SPELLINGS}
_FOREIGN = frozenset(
    ("%", "‰", "pct", "percent", "prozent", "mv", "kv", "bar", "pa", "hz", "w", "kw", "db", "lbf", "ft")
)
"""What is a unit too, of which a mapping cannot know how much it stands for."""

_ENDINGS = frozenset(
    (
        *("nm", "mnm", "knm", "ncm", "kn", "rad", "mrad", "urad", "deg", "grad", "rpm", "upm", "dps", "mm", "um", "cm"),
        *("ms", "us", "ns", "amps", "counts", "ticks", "inc", "incr", "pct", "percent", "turns", "revs", "degc", "mv"),
    )
)
"""Last words of names, as in `torque_nm`, that are units by themselves."""

_LETTERS: dict[str, tuple[Role, ...]] = {
    **{"A": ("current",), "mA": ("current",), "N": ("force",), "m": ("position",), "s": ("", "other")},
    **{"m/s": ("speed", ""), "N m": ("torque", "")},
    "V": ("voltage", "", "torque", "current", "force", "angle", "position", "speed", "acceleration"),
}
"""Last letters that are units too where the words before agree; else they are a joint's name or a motor's."""

_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_INDEX = re.compile(r"(\((:,\s*\d+|\d+\s*,:)\)|[{\[(]\d+[}\])]|\.(Data|data|Value|values?))+$")
_NUMBERED = re.compile(r"^(a|j|q|m|joint|axis|achse|axe|gelenk|motor|mot|ch)?\d+$", re.IGNORECASE)
_MEGA = ("MN", "MA")
_MOST_PARTS = 4


@dataclass(frozen=True)
class Stated:
    """What a log says of a signal's unit, as settings write it or `CONVERTED` has it, and raw; empty where nothing.

    The rest is the signal's name without it; `by_letter` where a last letter of that alone says so.
    """

    unit: str
    raw: str
    rest: str
    by_letter: bool = False


def spell(text: str) -> str:
    """Returns a unit as settings write it, or as `CONVERTED` has it; empty where it is no known one."""
    plain = without_accents(text).strip().strip("[]()").strip()
    if plain.startswith(_MEGA):
        return ""  # no milli
    plain = re.sub(r"[\s·⋅*.\-](?!1)", "", plain.lower().replace("µ", "u").replace("μ", "u").replace("²", "^2"))
    plain = plain.replace("per", "/").replace("sec", "s").replace("⁻¹", "^-1")
    plain = re.sub(
        r"^(.+?)[\s·*.]?(s|min)\^?-([12])$", lambda one: f"{one[1]}/{one[2]}^{one[3]}".removesuffix("^1"), plain
    )
    plain = re.sub(r"/s\^?2$|/s/s$", "/s^2", plain)
    return _SPELLINGS.get(plain, "")


def read_unit(name: str, unit: str = "", *, is_message: bool = False) -> Stated:
    """Reads a signal's unit by its name and what the log states beside it; brackets of messages hold a joint's name."""
    index = _INDEX.search(name)
    body, after = (name[: index.start()], index[0]) if index else (name, "")
    bracket = None if is_message else _BRACKET.search(body)
    inside = bracket[1] if bracket is not None else ""
    told = bool(inside) and (bool(spell(inside)) or _is_foreign(inside))
    rest = _BRACKET.sub("", body).rstrip() + after if told or (unit and inside) else name
    if unit:
        return Stated(spell(unit), unit, rest)
    if told:  # `nm` beside a position is no torque
        along = _role(rest) == "position" or tokens(rest)[:1] in (("x",), ("y",), ("z",))
        meant = "nanometre" if inside == "nm" and along else spell(inside)
        return Stated(meant, inside, rest, by_letter=len(inside) == 1 and inside.isalpha())
    return _at_end(body, after)


def _is_foreign(text: str) -> bool:
    """Whether a text in brackets is a unit, though an unknown one, rather than a word."""
    plain = text.strip().lower()
    return plain in _FOREIGN or text.strip().startswith(_MEGA) or bool(re.search(r"[%°²·^]|\w/\w", plain))


def _at_end(body: str, index: str) -> Stated:
    """The unit that the last words of a name are, before the number of a joint and an index."""
    words = [(found[0], found.start()) for found in re.finditer(r"[^\s_./:]+", body)]
    ends = [len(words)]
    if len(words) > 2 and _NUMBERED.match(words[-1][0]):
        ends.append(len(words) - 1)
    for end in ends:
        for count in range(min(_MOST_PARTS, end - 1), 0, -1):
            parts = [word for word, _ in words[end - count : end]]
            before = body[: words[end - count][1]].rstrip("_./: ")
            found = _joined(parts, before)
            if found is not None:
                after = f"_{body[words[end][1] :]}" if end < len(words) else ""
                return Stated(found[0], "_".join(parts), f"{before}{after}{index}", found[1])
    camel = re.search(r"(?<=[a-z])(Nm|Deg|Rad|Rpm|RPM|Amps|Counts)$", body)
    if camel is not None:
        return Stated(spell(camel[0]), camel[0], body[: camel.start()] + index)
    return Stated("", "", body + index)


def _joined(parts: list[str], before: str) -> tuple[str, bool] | None:
    """The unit that some last words make, and whether it is by a letter alone; None where they make none."""
    if len(parts) == 1:
        word = parts[0]
        if word.lower() in _ENDINGS:
            return spell(word), False
        unit = word if word in _LETTERS else ""
        return (unit, True) if unit and _role(before) in _LETTERS[unit] else None
    words = [one for one in parts if one.lower() != "per"]
    if len(words) > 2 and words[-1] == "2":
        words = [*words[:-2], f"{words[-2]}2"]
    if len(words) != 2:
        return None
    if "per" not in parts and words == ["N", "m"]:
        return ("N m", False) if _role(before) in _LETTERS["N m"] else None
    if words[1].lower() not in ("s", "sec", "min", "s2", "s^2"):
        return None
    unit = spell("/".join(words))
    role = _role(before)
    if unit == "m/s" and role not in _LETTERS["m/s"]:
        return None
    # In `vel_deg_per_s_2` the number is a joint's.
    rate: Role = "acceleration" if unit.endswith("^2") else "speed"
    return (unit, False) if unit and (rate == role or role not in ("speed", "acceleration")) else None


def _role(name: str) -> Role:
    """What the words of a name say, or a lone `i` or `f`."""
    words = tokens(name)
    found = [ROLES[word] for word in words if word in ROLES]
    letters: dict[str, Role] = {"i": "current", "f": "force"}
    return found[-1] if found else next((letters[one] for one in words if one in letters), "")

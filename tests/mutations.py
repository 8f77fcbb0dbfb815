"""Mutated settings files and command lines: each ends with a documented code and one message, and quickly."""

from __future__ import annotations

import contextlib
import copy
import hashlib
import io
import resource
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

PROCESSOR_S, ROOM_BYTES = 10.0, 1 << 30
"""What a case may take of the processor, and of memory above what the process had before."""

_VALUES = (
    *(
        "-1",
        "0",
        "1",
        "1e308",
        "-1e308",
        "1e-320",
        ".nan",
        ".inf",
        "-.inf",
        "1e9",
        "999999999999",
        "0x7fffffff",
        "1_000",
    ),
    *("null", "~", "true", "no", "''", '"\\0"', '"\\ud800"', "[]", "{}", "[[[[]]]]", "{a: {b: {c: 1}}}", "[1, 2, 3]"),
    *("2026-02-30", "2026-11-28T12:00:00Z", "!!int x", "!foo bar", "!!python/object:os.system {}", "*nothing", "&a 1"),
    *("../../../etc/passwd", "/dev/zero", "/dev/stdin", ".", "..", "~/x", "${ROBID_DATA}", "${nothing}", "{row.x}"),
    *("ß", "‮abc", "\x1b[31mred", "a" * 300, "9" * 5000, "1e", "--", "- - -", "? a", "|", ">-", "@x", "%x", "`x`"),
)
_NODES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1, 0.5, 3, 1e9, 10**17, 1e308, float("nan"), float("inf"), -0.0, 1e-320),
    *("", "x", "axis_1", "lift", "none", "all", "../..", "/dev/zero", "\x7f", "ß" * 40, "1e3", "estimation", "best"),
    *([], {}, [0], [1, 2, 3], [[1, 0], [0, 1]], ["x", "x"], {"x": 1}, {"from": "best"}, {"random": {"count": 3}}),
)
_COMMANDS = (
    ("status", "small.yaml"),
    ("status", "small.yaml", "--json"),
    ("run", "small.yaml", "--dry-run"),
    ("status", "small.yaml", "--run-dir", "elsewhere"),
    ("design-excitation", "small.yaml", "--campaign", "nothing"),
    ("export", "small.yaml", "--fit", "elastic", "--format", "json"),
)
_ARGUMENTS = (
    *(
        "status",
        "run",
        "fit",
        "validate",
        "inspect",
        "export",
        "report",
        "explain",
        "schema",
        "doctor",
        "design-configs",
    ),
    *(
        "small.yaml",
        "arm.yaml",
        "nothing.yaml",
        ".",
        "",
        "--json",
        "--dry-run",
        "--help",
        "--strict",
        "--fit",
    ),
    *(
        "--campaign",
        "--design",
        "--run-dir",
        "--input",
        "--output",
        "--backend",
        "--workers",
        "--scheduler",
        "--nothing",
    ),
    *(
        "elastic",
        "estimation",
        "best",
        "serial",
        "dask",
        "-1",
        "0",
        "1e9",
        "1000000",
        "x" * 300,
        "\udcff",
        "\x1b[1m",
        "D208",
    ),
)


def mutated_tree(text: str, generator: np.random.Generator) -> tuple[str, str]:
    """Returns a text of YAML whose tree differs in one or two values or keys, and how."""
    yaml = YAML(typ="safe", pure=True)
    tree, how = yaml.load(text), []
    for _ in range(int(generator.integers(1, 3))):
        place = _places(tree)[int(generator.integers(len(_places(tree))))]
        parent = tree
        for step in place[:-1]:
            parent = parent[step]
        kind = str(generator.choice(["value", "value", "value", "gone", "key", "size", "moved"]))
        value = parent[place[-1]]
        if kind == "gone":
            del parent[place[-1]]
        elif kind == "key" and isinstance(parent, dict):
            parent[str(_NODES[int(generator.integers(len(_NODES)))]) if generator.random() < 0.3 else "other"] = value
        elif kind == "size" and isinstance(value, int | float) and not isinstance(value, bool):
            parent[place[-1]] = value * float(generator.choice([-1, 0, 1e-9, 0.5, 1.5, 1e3, 1e9, 1e300]))
        elif kind == "moved":
            other = _places(tree)[int(generator.integers(len(_places(tree))))]
            found = tree
            for step in other:
                found = found[step]
            parent[place[-1]] = copy.deepcopy(found)
        else:
            parent[place[-1]] = _NODES[int(generator.integers(len(_NODES)))]
        how.append(f"{kind} at {'.'.join(map(str, place))}")
    stream = io.StringIO()
    yaml.dump(tree, stream)
    return stream.getvalue(), ", ".join(how)


def _places(tree: Any) -> list[tuple[Any, ...]]:
    """Paths to everything in a tree but its root."""
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return [(key, *rest) for key, value in pairs for rest in [(), *_places(value)]]


def mutated(text: str, generator: np.random.Generator) -> tuple[str, str]:
    """Returns a text that differs in one to three places, and how."""
    how = []
    for _ in range(int(generator.integers(1, 4))):
        name, mutation = _MUTATIONS[int(generator.integers(len(_MUTATIONS)))]
        lines = text.split("\n")
        at = int(generator.integers(len(lines)))
        text = "\n".join(mutation(lines, at, generator))
        how.append(f"{name} in line {at + 1}")
    return text, ", ".join(how)


def _value(generator: np.random.Generator) -> str:
    return _VALUES[int(generator.integers(len(_VALUES)))]


def _replace(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    key, colon, _ = lines[at].partition(":")
    lines[at] = f"{key}: {_value(generator)}" if colon else f"{lines[at]} {_value(generator)}"
    return lines


def _replace_within(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    words = lines[at].split(" ")
    words[int(generator.integers(len(words)))] = _value(generator)
    lines[at] = " ".join(words)
    return lines


def _delete(lines: list[str], at: int, _: np.random.Generator) -> list[str]:
    return lines[:at] + lines[at + 1 :]


def _repeat(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    return lines[: at + 1] + [lines[at]] * int(generator.choice([1, 2, 1000])) + lines[at + 1 :]


def _swap(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    other = int(generator.integers(len(lines)))
    lines[at], lines[other] = lines[other], lines[at]
    return lines


def _indent(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    lines[at] = str(generator.choice([" ", "  ", "\t", "    "])) + lines[at].lstrip() * int(generator.integers(1, 3))
    return lines


def _rename(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    other = lines[int(generator.integers(len(lines)))].strip().partition(":")[0]
    space = lines[at][: len(lines[at]) - len(lines[at].lstrip())]
    lines[at] = f"{space}{other}:{lines[at].partition(':')[2]}"
    return lines


def _nest(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    depth = int(generator.choice([3, 30, 500, 5000]))
    key = lines[at].partition(":")[0]
    lines[at] = f"{key}: {'[' * depth}{']' * depth}"
    return lines


def _anchor(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    key, colon, value = lines[at].partition(":")
    lines[at] = f"{key}: &a{value}" if colon and generator.random() < 0.5 else f"{key}: {{<<: *a}}"
    return lines


def _character(lines: list[str], at: int, generator: np.random.Generator) -> list[str]:
    place = int(generator.integers(len(lines[at]) + 1))
    lines[at] = lines[at][:place] + str(generator.choice(list(":-{}[]#&*!|>'\"%@`\0\x85\ufeff"))) + lines[at][place:]
    return lines


_Mutation = Callable[[list[str], int, np.random.Generator], list[str]]
_MUTATIONS: tuple[tuple[str, _Mutation], ...] = (
    ("another value", _replace),
    ("another value", _replace),
    ("another word", _replace_within),
    ("deleted", _delete),
    ("repeated", _repeat),
    ("swapped", _swap),
    ("indented", _indent),
    ("another key", _rename),
    ("nested", _nest),
    ("an anchor or a merge", _anchor),
    ("another character", _character),
)


def settings_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A mutated experiment or robot file, as a command reads it."""
    import damage

    for name in ("small.yaml", "arm.yaml"):
        shutil.copy(folder / name, work)
    path = work / str(generator.choice(["small.yaml", "small.yaml", "arm.yaml"]))
    whole = path.read_text(encoding="utf-8")
    chance = generator.random()
    if chance < 0.6:
        text, how = mutated_tree(whole, generator)
        path.write_text(text, encoding="utf-8")
    elif chance < 0.7:
        how, content = damage.damage(whole.encode(), generator)
        path.write_bytes(content)
    else:
        text, how = mutated(whole, generator)
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
    command = _COMMANDS[int(generator.integers(len(_COMMANDS)))]
    return _ended(work, command, f"{path.name}, {how}")


def command_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A command line at random over sound files."""
    for name in ("small.yaml", "arm.yaml"):
        shutil.copy(folder / name, work)
    count = int(generator.integers(1, 6))
    words = [_ARGUMENTS[int(generator.integers(len(_ARGUMENTS)))] for _ in range(count)]
    # A command that computes is none of this: it would take its time by right.
    if words[0] in ("run", "fit", "validate", "design-configs") and "--dry-run" not in words:
        words = ["status", *words[1:]]
    return _ended(work, tuple(words), "command line")


def _ended(work: Path, command: tuple[str, ...], how: str) -> str:
    """Runs a command and says how it ended; raises `damage.Wrong` where it is not as it must be."""
    import damage

    before = _contents(work)
    begun, room = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with contextlib.chdir(work):
        code, text = damage.robid(*command)
    took = time.process_time() - begun
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - room)
    if took > PROCESSOR_S:
        raise damage.Wrong(f"{how}: {command} took {took:.1f} s")
    if grown > ROOM_BYTES:
        raise damage.Wrong(f"{how}: {command} took {grown / 2**20:.0f} MiB")
    after = {name: digest for name, digest in _contents(work).items() if not name.startswith("runs/")}
    if after != before:
        raise damage.Wrong(f"{how}: {command} changed {sorted(set(after.items()) ^ set(before.items()))[:2]}")
    return f"refused: {code}: {' '.join(text.split())[:200]}" if code in (2, 3, 4) else f"same: {code}"


def _contents(work: Path) -> dict[str, str]:
    files = (path for path in work.rglob("*") if path.is_file())
    return {str(path.relative_to(work)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}

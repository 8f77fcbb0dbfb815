"""How solvers may end on problems that are near-singular, stiff, badly scaled or degenerate."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import time
import traceback
import warnings
from dataclasses import fields, is_dataclass
from functools import cache

import numpy as np

import robid

LIMIT_S = 20.0


def outcome(call, limit_s=LIMIT_S):
    """How a call ends: with a result whose numbers are fit to be read, refused with a remedy, or `WRONG: ...`."""
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = call()
            unfit = [*unfit_numbers(result), *unfit_words(result)]
        ended = f"WRONG: {'; '.join(unfit[:12])}" if unfit else f"ended: {status_of(result)}"
    except robid.RobidError as error:
        ended = f"refused: {error.codes[0]}" if error.codes and error.remedy else f"WRONG: bare refusal: {error}"
    except Exception as error:  # noqa: BLE001
        frames = [f"{f.filename.rpartition('/')[2]}:{f.lineno}" for f in traceback.extract_tb(error.__traceback__)[-4:]]
        ended = f"WRONG: {type(error).__name__}: {error} at {' '.join(frames)}"
    taken = time.process_time() - begun
    return f"WRONG: took {taken:.1f} s, then {ended}" if taken > limit_s else ended


_FINITE = ("value", "internal", "total", "misfit", "response", "coherence", "efficiency")


@cache
def _says(kind, name):
    """What a dataclass says of one of its fields: comments before it, its annotation, and the class's docstring."""
    lines = textwrap.dedent(inspect.getsource(kind)).splitlines()
    body = ast.parse("\n".join(lines)).body[0].body
    ends = [0, *(node.end_lineno for node in body)]
    declared = [
        "\n".join(lines[before : node.end_lineno])
        for before, node in zip(ends, body, strict=False)
        if isinstance(node, ast.AnnAssign) and node.target.id == name
    ]
    return "\n".join([inspect.getdoc(kind) or "", *declared])


def _walk(value, path="", said=""):
    """Yields the place of every number and text of a result, with what is documented of it."""
    if is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from _walk(getattr(value, field.name), f"{path}.{field.name}", _says(type(value), field.name))
    elif isinstance(value, list | tuple | dict):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _walk(one, f"{path}[{key}]", said)
    else:
        yield path, value, said


def unfit_numbers(result):
    """Names the numbers of a result that are none and documented nowhere, or infinite where they must not be."""
    found = []
    for path, value, said in _walk(result):
        array = np.asarray(value)
        if array.dtype.kind not in "fc":
            continue
        if np.isnan(array).any() and "NaN" not in said:
            found.append(f"{path} is not a number")
        elif path.rpartition(".")[2] in _FINITE and np.isinf(array).any():
            found.append(f"{path} is infinite")
    return found


def unfit_words(result):
    """Names the texts of a result that show a number which is none."""
    texts = [(path, value) for path, value, _ in _walk(result) if isinstance(value, str)]
    shown = [("repr", repr(result)), ("sentence", getattr(result, "sentence", ""))]
    return [
        f"{path} says `{text[:200]}`" for path, text in [*texts, *shown] if re.search(r"(?<![\w])-?nan(?![\w])", text)
    ]


def status_of(result):
    """Says how a fit ended, and whether it says what to do where it has not converged."""
    estimate = getattr(getattr(result, "found", None), "estimate", None)
    if estimate is None:
        return type(result).__name__
    if estimate.status != "converged" and not estimate.advice:
        message = f"{estimate.status} without advice"
        raise AssertionError(message)
    return estimate.status

"""References to functions that are imported when they are called."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

import robid
from robid.later import later


def _written():
    for file in Path(robid.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "later":
                yield ast.literal_eval(node.args[0])


@pytest.mark.parametrize("where", sorted(set(_written())))
def test_every_reference_leads_somewhere(where):
    module, _, name = where.partition(":")
    assert hasattr(import_module(module), name)


def test_a_reference_imports_when_it_is_called():
    assert later("robid.pipeline.nowhere:run") is not None
    with pytest.raises(ModuleNotFoundError):
        later("robid.pipeline.nowhere:run")()
    assert later("math:hypot")(3.0, 4.0) == 5.0
    assert later("math:pi").value > 3

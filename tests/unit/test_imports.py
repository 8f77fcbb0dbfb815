"""Modules import each other in one direction, imports inside functions counted."""

import ast
import graphlib
from pathlib import Path

_ROOT = Path(__file__).parents[2]


def modules():
    names = {}
    for file in sorted((_ROOT / "robid").rglob("*.py")):
        name = ".".join(file.relative_to(_ROOT).with_suffix("").parts)
        names[name.removesuffix(".__init__")] = file
    return names


def imports(file, known):
    """What a module imports, of which what annotations alone need is no part."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for_types = [
        node for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    ]
    left_out = {id(inner) for node in for_types for inner in ast.walk(node)}
    found = set()
    for node in ast.walk(tree):
        if id(node) in left_out:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inner & known.keys() or {node.module}
    return found & known.keys()


def test_no_module_imports_itself_by_way_of_others():
    known = modules()
    graph = {name: imports(file, known) - {name} for name, file in known.items()}
    assert sum(map(len, graph.values())) > len(known)
    # Raises `CycleError`, which names the circle.
    graphlib.TopologicalSorter(graph).prepare()

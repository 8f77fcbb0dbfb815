"""Functions that are imported when they are called."""

import dataclasses
import inspect
import subprocess
import sys

import pytest

from robid.later import Later, later
from robid.models.known import FAMILIES
from robid.settings.fits import FitSettings


def functions(family):
    fields = {field.name: getattr(family, field.name) for field in dataclasses.fields(family)}
    fields |= {f"exports.{name}": export.make for name, export in family.exports.items()}
    return {name: value for name, value in fields.items() if isinstance(value, Later)}


@pytest.mark.parametrize("family", FAMILIES.values(), ids=list(FAMILIES))
def test_every_function_of_a_family_is_there_and_is_of_its_own_room(family):
    found = functions(family)
    assert {"fit", "validate", "phrase", "report", *(f"exports.{name}" for name in family.exports)} <= set(found)
    for value in found.values():
        assert inspect.isfunction(value.value) or issubclass(value.value, FitSettings)
        assert value.module.startswith(f"robid.models.{family.name}.")


def test_nothing_is_imported_before_the_call_and_everything_else_is():
    code = (
        "import sys\nfrom robid.later import later\nwith later(__name__):\n    from colorsys import rgb_to_hsv\n"
        "    import tabnanny\nassert 'colorsys' not in sys.modules and 'tabnanny' in sys.modules\n"
        "assert rgb_to_hsv(1, 1, 1) == (0.0, 0.0, 1)\nassert 'colorsys' in sys.modules\n"
        "from colorsys import hls_to_rgb\n"
        "assert callable(hls_to_rgb) and hls_to_rgb.__module__ == 'colorsys'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_imports_of_other_modules_are_as_ever_within_the_block():
    import_before = __builtins__["__import__"] if isinstance(__builtins__, dict) else __builtins__.__import__
    with later("another.module"):
        from colorsys import rgb_to_yiq
    assert inspect.isfunction(rgb_to_yiq)
    import builtins

    assert builtins.__import__ is import_before


def test_a_name_that_is_not_there_fails_with_the_call():
    with later(__name__):
        from colorsys import no_such_function  # type: ignore[attr-defined]
    with pytest.raises(AttributeError):
        no_such_function()

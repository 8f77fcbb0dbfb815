"""What a shell completes: bash itself is asked, with the script that robid prints for it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")

_ASK = """
eval "$(_ROBID_COMPLETE=source_bash robid)"
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
_robid_completion robid
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def complete(shop):
    """Returns what asks bash what it would offer for the last of some words."""
    command = shop.folder / "robid"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m robid "$@"\n')
    command.chmod(0o755)
    here = {
        "PATH": f"{shop.folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }

    def ask(*words: str) -> set[str]:
        given = " ".join(f"'{word}'" for word in ("robid", *words))
        asked = ["bash", "-c", f"COMP_WORDS=({given})\n{_ASK}"]
        done = subprocess.run(asked, cwd=shop.folder, env=here, capture_output=True, text=True, check=True, timeout=60)
        assert done.stderr == ""
        return set(done.stdout.split())

    return ask


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("estimate",), {"estimate-frf"}),
        (("simulate-or-acquire", "small.yaml", "--cam"), {"--campaign"}),
        (("simulate-or-acquire", "small.yaml", "--campaign", ""), {"candidates", "estimation", "validation"}),
        (("simulate-or-acquire", "small.yaml", "--campaign", "v"), {"validation"}),
        (("fit", "small.yaml", "--fit", ""), {"elastic"}),
        (("export", "small.yaml", "--format", "json", "--fit", ""), {"elastic"}),
        (("export", "small.yaml", "--format", "m"), {"mat", "mjcf"}),
        (("run", "small.yaml", "--backend", ""), {"serial", "processes", "dask"}),
        (("explain", "S37"), {f"S37{last}" for last in range(10)}),
        (("explain", "tr"), {"trust"}),
        (("schema", "--of", "sta"), {"status"}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_commands_options_and_names_of_the_file_are_completed(complete, words, offered):
    assert complete(*words) == offered


@pytest.mark.parametrize(("stage", "foreign"), [("report", "--strict"), ("estimate-frf", "--try"), ("fit", "--design")])
def test_a_stage_offers_and_takes_its_own_options_only(complete, shop, stage, foreign):
    assert foreign not in complete(stage, "--")
    shop.refuse(2, "S377", foreign, command=(stage, "small.yaml", foreign, "x"))


def test_a_file_that_cannot_be_read_completes_nothing(complete, shop):
    (shop.folder / "broken.yaml").write_text("campaigns: [")
    assert complete("estimate-frf", "broken.yaml", "--campaign", "") == set()
    assert complete("estimate-frf", "none.yaml", "--campaign", "") == set()

"""What the parts of `make test-hard` find, kept by each and added up in `runs/hard/summary.json`, flat."""

import json
import sys
from collections import Counter
from pathlib import Path

RUNS = Path(__file__).parents[1] / "runs/hard"


def note(part, first, outcomes):
    """Keeps how many ended how, and what nobody expected, for the summary."""
    wrong = {seed: what for seed, what in outcomes.items() if what.startswith("WRONG")}
    counted = Counter(":".join(what.split(":")[:2]) if part in ("settings", "command", "process") else
                      what.partition(":")[0] for what in outcomes.values() if not what.startswith("WRONG"))  # fmt: skip
    RUNS.mkdir(parents=True, exist_ok=True)
    content = {"part": part, "first": first, "cases": len(outcomes), "counted": counted, "unexpected": wrong}
    (RUNS / f"{part}_{first}.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    assert not wrong, "\n".join(f"{part} {seed}: {what}" for seed, what in wrong.items())


def summary(folder):
    """Returns counts by part and outcome; `unexpected` is what no case may be."""
    found, unexpected = Counter(), 0
    for path in sorted(folder.glob("*_*.json")):
        part = json.loads(path.read_text(encoding="utf-8"))
        found[f"{part['part']}.cases"] += part["cases"]
        unexpected += len(part["unexpected"])
        for outcome, count in part["counted"].items():
            found[f"{part['part']}.{outcome.replace(': ', '_').replace(':', '')}"] += count
    return {**dict(sorted(found.items())), "unexpected": unexpected}


if __name__ == "__main__":
    content = summary(RUNS)
    (RUNS / "summary.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    sys.stdout.write(json.dumps(content, indent=2) + "\n")

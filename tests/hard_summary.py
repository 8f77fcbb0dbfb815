"""Adds up what the parts of `make test-hard` found, in `runs/hard/summary.json`, flat."""

import json
import sys
from collections import Counter
from pathlib import Path

RUNS = Path(__file__).parents[1] / "runs/hard"


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

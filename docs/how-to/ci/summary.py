"""ci/summary.py: says in Markdown what `robid run --json`, or `robid reprocess --json --stream`, printed into a file."""

import json
import sys
from pathlib import Path

GRADES = {2: "trust", 1: "predicts, but single parameters may be off", 0: "do not use"}


def main(path):
    text = Path(path).read_text(encoding="utf-8") if Path(path).is_file() else ""
    if not text:
        return "robid printed nothing."
    # A stream has an object on each line, the last of which is about all of them.
    told = json.loads(text if text.startswith("{\n") else text.splitlines()[-1])
    if told["type"] == "error":
        return f"## robid stopped\n\n```\n{told['error']}\n```"
    if told["json_version"].partition(".")[0] != "1":
        return f"This summary reads version 1 of `{told['type']}`, not {told['json_version']}."
    return fleet(told) if told["type"] == "reprocess" else run(told)


def run(told):
    lines = [f"## {told['verdict']['text']}", ""]
    graded = [node for node in told["nodes"] if node["grade"] is not None]
    lines += [f"- `{one['name']}`: **{GRADES[one['grade']]}**. {one['grade_sentence']}" for one in graded]
    lines += [f"- `{one['output']}`: {one['problem']}" for one in told["nodes"] if one["problem"]]
    for fit, rows in told["parameters"].items():
        lines += ["", f"| {fit} | estimate | lower | upper | unit |", "|---|--:|--:|--:|---|"]
        lines += [f"| {row['name']} | {cells(row)} | {row['unit']} |" for row in rows if row["identified"]]
    return "\n".join(lines)


def cells(row):
    numbers = (row["estimate"], row["lower"], row["upper"])
    return " | ".join("" if number is None else f"{number:.5g}" for number in numbers)


def fleet(told):
    lines = [f"## {told['rows']} rows: {told['made']} made, {told['fresh']} fresh, {len(told['failed'])} failed", ""]
    lines += [f"- `{one['id']}` failed: {one['message']}; {one['remedy']}" for one in told["failed"]]
    lines += [f"- `{name}`: **do not use**" for name in told["do_not_use"]]
    lines += [f"- `{one['id']}` is off the fleet: {one['name']} by {one['away']:.1f} deviations" for one in told["outliers"]]
    lines += [f"- `{one['robot']}` drifts: {one['name']} by {one['change']:+.2g}" for one in told["drifts"]]
    return "\n".join(lines)


if __name__ == "__main__":
    print(main(sys.argv[1]))

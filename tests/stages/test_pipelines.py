"""The pipelines of `docs/how-to/ci/`: what GitHub and GitLab ask of such a file, and their commands, which run."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from scipy.io import savemat

from settings_tables import ROOT
from two_mass_log import STIFFNESS, bench_log

_HERE = Path(__file__).parent
FILES = ROOT / "docs/how-to/ci"
STEP = {"name", "if", "uses", "run", "with"}
JOB = {"runs-on", "steps", "timeout-minutes", "if"}
GITLAB_JOB = {
    "stage",
    "timeout",
    "resource_group",
    "rules",
    "cache",
    "script",
    "after_script",
    "allow_failure",
    "artifacts",
}
GITLAB_WORDS = {"workflow", "stages", "variables", "default"}
INSTALL = "python -m pip install -r requirements.txt"
ENDS = {"identify": (0,), "fleet": (0, 5)}  # a fleet of one bench may have a row that is not to be used


def read(name):
    """Reads a file by YAML 1.2, as GitHub does: `on` is a word."""
    return YAML(typ="safe", pure=True).load((FILES / name).read_text(encoding="utf-8"))


def github():
    """Commands of each job, those of its summary apart, and its variables."""
    document = read("github-actions.yml")
    found = {}
    for name, job in document["jobs"].items():
        runs = [step for step in job["steps"] if "run" in step]
        main = [step["run"] for step in runs if "if" not in step]
        found[name] = main, [step["run"] for step in runs if "if" in step], document["env"]
    return found


def gitlab():
    """The same of GitLab."""
    document = read("gitlab-ci.yml")
    jobs = {name: job for name, job in document.items() if name not in GITLAB_WORDS}
    before, variables = document["default"]["before_script"], document["variables"]
    return {name: ([*before, *job["script"]], job["after_script"], variables) for name, job in jobs.items()}


PIPELINES = {"github": github, "gitlab": gitlab}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A repository with an example, a fleet of one robot, and the summary."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "ci").mkdir()
    shutil.copy(FILES / "summary.py", folder / "ci")
    (folder / "fleet/logs").mkdir(parents=True)
    shutil.copy(_HERE / "fleet.yaml", folder / "fleet/bench.yaml")
    shutil.copy(_HERE / "bench_robot.yaml", folder / "fleet")
    savemat(folder / "fleet/logs/soft.mat", bench_log(0.9 * STIFFNESS, 0))
    (folder / "fleet/robots.csv").write_text("id,log,step_s\nsoft,logs/soft.mat,1e-3\n")
    assert shell(folder, "robid init drive --example drive").returncode == 0
    return folder


def shell(folder, text, **variables):
    """Runs commands as both services do, in a Bash that stops at the first failure."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    here = {**os.environ, **variables, "PATH": path, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", text]
    return subprocess.run(command, cwd=folder, env=here, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("service", PIPELINES)
@pytest.mark.parametrize("job", ENDS)
def test_the_commands_of_a_job_run(project, service, job):
    main, after, variables = PIPELINES[service]()[job]
    assert main[0] == INSTALL
    summary = project / "summary.md"
    summary.unlink(missing_ok=True)
    named = {**variables, "GITHUB_STEP_SUMMARY": str(summary)}
    done = shell(project, "\n".join(main[1:]), **named)
    assert done.returncode in ENDS[job], done.stderr
    assert shell(project, "\n".join(after), **named).returncode == 0
    text = summary.read_text(encoding="utf-8")
    if job == "identify":
        told = json.loads((project / "result.json").read_text())
        assert told["verdict"]["text"] in text
        assert "`elastic`: **trust**" in text
        (stiffness,) = (row for row in told["parameters"]["elastic"] if row["kind"] == "stiffness")
        assert f"| {stiffness['name']} | {stiffness['estimate']:.5g} | " in text
    else:
        assert text.startswith("## 1 rows: ")
        assert [json.loads(line)["type"] for line in (project / "rows.jsonl").read_text().splitlines()] == [
            "reprocess-row",
            "reprocess",
        ]


def test_a_job_that_fails_says_why_in_its_summary(tmp_path, project):
    main, after, variables = github()["identify"]
    shutil.copytree(project / "ci", tmp_path / "ci")
    named = {**variables, "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md")}
    assert shell(tmp_path, "\n".join(after), **named).returncode == 0
    assert shell(tmp_path, main[-1], **named).returncode == 2
    assert shell(tmp_path, "\n".join(after), **named).returncode == 0
    text = (tmp_path / "summary.md").read_text()
    assert text.startswith("robid printed nothing.\n## robid stopped\n")
    assert "drive/drive.yaml" in text


def test_the_github_file_has_what_github_asks_for():
    document = read("github-actions.yml")
    assert set(document) == {"name", "on", "permissions", "concurrency", "defaults", "env", "jobs"}
    assert set(document["on"]) == {"push", "pull_request", "schedule", "workflow_dispatch"}
    (schedule,) = document["on"]["schedule"]
    assert re.fullmatch(r"\d{1,2} \d{1,2} \* \* \*", schedule["cron"])
    assert document["defaults"]["run"]["shell"] == "bash"
    for job in document["jobs"].values():
        assert {"runs-on", "steps"} <= set(job) <= JOB
        assert isinstance(job["timeout-minutes"], int)
        for step in job["steps"]:
            assert set(step) <= STEP
            assert ("uses" in step) != ("run" in step)
            assert "run" not in step or ("with" not in step and "${{" not in step["run"])
            assert "uses" not in step or re.fullmatch(r"actions/[a-z-]+(/[a-z]+)?@v\d+", step["uses"])
        cached = [step["with"] for step in job["steps"] if step.get("uses", "").startswith("actions/cache/")]
        assert len({(one["path"], one["key"]) for one in cached}) == 1, "what is saved is what is fetched"
        assert cached[0]["key"].startswith(cached[0]["restore-keys"])


def test_the_gitlab_file_has_what_gitlab_asks_for():
    document = read("gitlab-ci.yml")
    jobs = {name: job for name, job in document.items() if name not in GITLAB_WORDS}
    assert set(document) - set(jobs) == GITLAB_WORDS
    for job in jobs.values():
        assert {"stage", "script"} <= set(job) <= GITLAB_JOB
        assert job["stage"] in document["stages"]
        assert all(isinstance(line, str) for line in [*job["script"], *job["after_script"]])
        assert job["artifacts"]["when"] == "always"
        assert {cache["key"] for cache in job["cache"]} >= {"pip"}
        for rule in job.get("rules", []):
            assert re.fullmatch(r'\$CI_\w+ == "\w+"', rule["if"])
    assert jobs["identify"]["allow_failure"] == {"exit_codes": 5}


def test_both_run_the_same_and_use_only_what_is_defined():
    both = [make() for make in PIPELINES.values()]
    assert both[0].keys() == both[1].keys() == ENDS.keys()
    for job in ENDS:
        assert both[0][job][0] == both[1][job][0]
        for main, after, variables in (both[0][job], both[1][job]):
            used = set(re.findall(r"\$(\w+)", "\n".join([*main, *after])))
            assert used <= {*variables, "GITHUB_STEP_SUMMARY"}


@pytest.mark.skipif(shutil.which("jq") is None, reason="needs jq")
def test_the_examples_of_reading_answers_run(project):
    page = (ROOT / "docs/reference/json-output.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```sh\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    lines = block.replace("configs/fleet/robots.csv configs/fleet/arm.yaml", "fleet/robots.csv fleet/bench.yaml")
    outs = []
    for line in lines.splitlines():
        if not line.startswith("robid init"):
            done = shell(project, line)
            assert done.returncode in (0, 5), (line, done.stderr)
            outs.append(done.stdout)
    assert "elastic: grade 2, " in outs[2]
    assert any(row.split("\t")[0] == "drive" for row in outs[3].splitlines())
    assert outs[4] == "true\n"
    (block,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    done = shell(project, f"{sys.executable} - <<'END'\n{block}\nprint(stiffness)\nEND")
    assert re.fullmatch(r"\{'gear_drive': [\d.]+\}\n", done.stdout), done.stderr

"""What provenance is made of: a hash of settings, package versions, the source tree's commit, the time."""

from __future__ import annotations

import hashlib
import json
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import robid
from robid.versions import package_versions as package_versions


def canonical_hash(value: object) -> str:
    """SHA-256 of a plain value (mappings, lists, scalars), whatever the order of its keys."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def git_commit() -> str:
    """Commit of robid's source tree, with `+` where files differ from it; "" outside a checkout."""
    root = Path(robid.__file__).parent.parent
    if not (root / ".git").exists():
        return ""
    commit = _git(root, "rev-parse", "HEAD")
    return commit + ("+" if commit and _git(root, "status", "--porcelain", "--untracked-files=no") else "")


def utc_now() -> str:
    """The time, as provenance records it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""

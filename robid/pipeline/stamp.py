"""How a report came about, as it says itself."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path

from robid.artifacts.artifact import Provenance
from robid.errors import ArtifactError

_STAMP = re.compile(r'<script type="application/json" id="provenance">(.*?)</script>', re.DOTALL)


def stamped(page: str, provenance: Provenance) -> str:
    """Returns a page that says how it came about, see `read_stamp`."""
    stamp = json.dumps(asdict(provenance), sort_keys=True).replace("<", "\\u003c")
    mark = f'<script type="application/json" id="provenance">{stamp}</script>\n'
    return page.replace("</body>", f"{mark}</body>", 1)


def read_stamp(path: Path) -> Provenance:
    """Reads how a report came about.

    Raises:
        ArtifactError: If the page does not say it, or cannot be read.
    """
    remedy = "move it away; `robid report EXPERIMENT.yaml` makes it again"
    try:
        found = _STAMP.findall(path.read_text(encoding="utf-8"))
        if found:
            return Provenance(**json.loads(found[-1]))
    except (OSError, ValueError, TypeError) as error:
        raise ArtifactError(f"The page is damaged: {error}.", where=str(path), remedy=remedy) from error
    raise ArtifactError("The page does not say what it was made from.", where=str(path), remedy=remedy)

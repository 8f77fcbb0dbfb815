"""Parts of an artifact, one per configuration, so that a killed stage resumes."""

from __future__ import annotations

import shutil
from pathlib import Path

from robid.artifacts.artifact import Artifact, Kind
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import ArtifactError


class Parts:
    """The folder `<artifact>.parts/`.

    Args:
        artifact: The artifact that the parts will be merged into.
        kind: Kind of the parts.
        key: Hash of everything that decides a part's content: settings and input hashes, see
            `robid.artifacts.provenance.canonical_hash`. Parts with another key are discarded.
    """

    def __init__(self, artifact: Path, kind: Kind, key: str) -> None:
        self.folder = artifact.with_name(artifact.name + ".parts")
        self._kind = kind
        self._suffix = f".{key[:16]}.h5"
        if self.folder.is_dir():
            for path in self.folder.iterdir():
                if not path.name.endswith(self._suffix):
                    path.unlink()

    def has(self, index: int) -> bool:
        """Tells whether a part is there and sound; a damaged one is discarded."""
        path = self._path(index)
        if not path.exists():
            return False
        try:
            read_artifact(path, self._kind)
        except ArtifactError:
            path.unlink()
            return False
        return True

    def write(self, index: int, part: Artifact) -> None:
        """Writes one part at once."""
        write_artifact(self._path(index), part)

    def read(self, index: int) -> Artifact:
        """Reads one part; see `robid.artifacts.store.read_artifact` for errors."""
        return read_artifact(self._path(index), self._kind)

    def finish(self) -> None:
        """Removes the folder, once the merged artifact is written."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, index: int) -> Path:
        return self.folder / f"{index:05d}{self._suffix}"

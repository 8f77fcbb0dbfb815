"""Walking through an HDF5 file that somebody else may have made: within the file, each object once, not for ever."""

from __future__ import annotations

from collections.abc import Iterator

import h5py

DEEPEST = 100
MOST_OBJECTS = 100_000


class OutsideError(ValueError):
    """A part of an HDF5 file lies in another file, which is not followed."""

    remedy = "Copy what lies there into the file, and take out what leads there."


class EndlessError(ValueError):
    """An HDF5 file has more, or more deeply nested, objects than any file of measurements."""

    remedy = "Write it again with its datasets in a few groups."


def datasets_in(root: h5py.Group) -> Iterator[tuple[str, h5py.Dataset]]:
    """Yields every dataset below a group once, with its path, in the order of names; soft links are not followed.

    Raises:
        OutsideError: If a link or a dataset leads to another file: an external link, external raw storage, a virtual
            dataset.
        EndlessError: If groups lie too deep in each other, or there are too many objects.
    """
    left: list[tuple[str, int, h5py.Group | h5py.Dataset]] = [("", 0, root)]
    seen = {h5py.h5o.get_info(root.id).addr}
    while left:
        path, depth, item = left.pop()
        if isinstance(item, h5py.Dataset):
            check_inside(path, item)
            yield path, item
        elif isinstance(item, h5py.Group):
            inside = []
            for name in item:
                below = f"{path}/{name}" if path else name
                check_link(below, item, name)
                if isinstance(item.get(name, getlink=True), h5py.HardLink):
                    child = item[name]
                    address = h5py.h5o.get_info(child.id).addr
                    if address not in seen:
                        seen.add(address)
                        inside.append((below, depth + 1, child))
                if depth >= DEEPEST or len(seen) > MOST_OBJECTS:
                    many = f"there are more than {MOST_OBJECTS} objects"
                    raise EndlessError(f"its groups do not end: {many if depth < DEEPEST else path[:60] + '...'}")
            left.extend(reversed(inside))


def check_link(path: str, group: h5py.Group, name: str) -> None:
    """Refuses a member of a group that lies in another file; see `datasets_in`."""
    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        raise OutsideError(f"`{path}` lies in another file, by an external link")


def check_inside(path: str, dataset: h5py.Dataset) -> None:
    """Refuses a dataset whose values lie in another file; see `datasets_in`."""
    made = dataset.id.get_create_plist()
    if made.get_external_count():
        raise OutsideError(f"`{path}` lies in another file, by external storage")
    if made.get_layout() == h5py.h5d.VIRTUAL:
        raise OutsideError(f"`{path}` lies in another file, as a virtual dataset")

"""Addresses of schedulers: which of them others could listen to."""

from __future__ import annotations

import socket
from contextlib import suppress

_PLAIN = ("tcp", "ws")


def warning_of(address: str | None) -> str:
    """Says what speaks against the address of a scheduler; empty where nothing does."""
    scheme, _, rest = (address or "").rpartition("://")
    if not rest or (scheme or "tcp") not in _PLAIN or _is_here(_host(rest)):
        return ""
    what = f"B014 the scheduler {address} is on another machine, and what goes there is not encrypted"
    return f"{what}: others in the network can read it and run code on the workers; use `tls://`"


def _host(rest: str) -> str:
    """The host of `host:port`, `[::1]:8786` or a host alone."""
    place = rest.partition("/")[0]
    if place.startswith("["):
        return place[1:].partition("]")[0]
    return place.rpartition(":")[0] or place


def _is_here(host: str) -> bool:
    """Whether a host is this machine: only its own addresses can be bound."""
    with suppress(OSError, UnicodeError):
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_DGRAM)
        return bool(found) and all(_binds(family, place) for family, _, _, _, place in found)
    return False


def _binds(family: int, place: tuple[object, ...]) -> bool:
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind(place)
        return True
    return False

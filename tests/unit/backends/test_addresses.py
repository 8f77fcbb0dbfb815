import socket

import pytest

from robid.backends.addresses import warning_of

ELSEWHERE = "192.0.2.7"  # of the block that RFC 5737 keeps for documentation: no machine has it


@pytest.mark.parametrize(
    "address", [f"tcp://{ELSEWHERE}:8786", f"{ELSEWHERE}:8786", f"ws://{ELSEWHERE}", "tcp://[2001:db8::7]:8786"]
)
def test_a_plain_address_elsewhere_is_warned_of(address):
    assert "tls://" in warning_of(address)


@pytest.mark.parametrize(
    "address",
    [
        None,
        f"tls://{ELSEWHERE}:8786",
        "tcp://127.0.0.1:8786",
        "127.0.0.1:8786",
        "localhost:8786",
        f"wss://{ELSEWHERE}:1",
    ],
)
def test_what_is_encrypted_or_stays_here_is_not(address):
    assert warning_of(address) == ""


def test_own_addresses_of_this_machine_are_here():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((ELSEWHERE, 9))  # sends nothing, and chooses the address it would send from
        except OSError:
            pytest.skip("no route leads out of this machine")
        own = probe.getsockname()[0]
    assert warning_of(f"tcp://{own}:8786") == ""

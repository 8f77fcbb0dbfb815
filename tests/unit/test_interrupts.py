import os
import signal

import pytest

from robid import cli
from robid.backends.map import make_map
from robid.errors import DataError
from robid.interrupts import hearing


def swallowed(error=None):
    """Does as compiled code whose callback is interrupted: the interrupt is gone, or another error comes of it."""
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        if error is not None:
            raise error from None


@pytest.fixture
def command(monkeypatch):
    def run(body):
        monkeypatch.setattr(cli, "_app_for", lambda _arguments: lambda *_given, **_options: body())
        return cli.run_command(["status"])

    return run


@pytest.mark.parametrize("error", [TypeError("incompatible arguments"), DataError("No data.", where="a", remedy="b")])
def test_an_interrupt_that_comes_out_as_another_error_is_one(command, capsys, error):
    before = signal.getsignal(signal.SIGINT)
    assert command(lambda: swallowed(error)) == 130
    assert "interrupted; what is finished is kept" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_errors_of_later_commands_are_their_own(command, capsys):
    command(lambda: swallowed(TypeError()))

    def fail():
        raise TypeError("mine")

    assert command(fail) == 1
    assert "TypeError: mine" in capsys.readouterr().err


def test_a_map_stops_before_the_next_task_where_an_interrupt_was_swallowed():
    done = []

    def task(number):
        done.append(number)
        if number == 1:
            swallowed()

    with hearing(), pytest.raises(KeyboardInterrupt), make_map("serial", 1) as run:
        run(task, range(4))
    assert done == [0, 1]
    with make_map("serial", 1) as run:
        run(done.append, range(4))
    assert done == [0, 1, 0, 1, 2, 3]

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robid import cli
from robid.backends.map import make_map
from robid.errors import DataError
from robid.interrupts import hearing

ROOT = Path(__file__).parents[2]


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


def test_a_termination_ends_with_its_own_code_and_the_same_message(command, capsys):
    before = signal.getsignal(signal.SIGTERM)
    assert command(lambda: os.kill(os.getpid(), signal.SIGTERM)) == 143
    assert "interrupted; what is finished is kept" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_interrupt_within_a_callback_that_cannot_raise_comes_again(command):
    class Callback:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0)

    def body():
        Callback()
        time.sleep(20)

    begun = time.monotonic()
    assert command(body) == 130
    assert time.monotonic() - begun < 10


_IMPORTS = """
import os, signal, sys

wanted = sys.argv[1]

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == wanted:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
signal.signal(signal.SIGINT, signal.default_int_handler)
import robid.__main__
sys.argv[1:] = ["status", "configs/drive.yaml"]
robid.__main__.main()
"""


@pytest.mark.parametrize("module", ["typer", "robid.cli", "robid.commands.shared", "robid.models.known", "h5py"])
def test_an_interrupt_while_modules_are_imported_leaves_no_traceback(module):
    command = [sys.executable, "-c", _IMPORTS, module]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 130
    assert "Traceback" not in ended.stderr
    assert "ignored" not in ended.stderr


_TEXT = """
import os, signal
from robid import cli

def body(*_, **__):
    exec("os.kill(os.getpid(), signal.SIGINT)\\nwhile True: pass", globals())

cli._app_for = lambda _: body
cli.main()
"""


def test_an_interrupt_within_a_text_that_is_executed_ends_by_its_code(tmp_path):
    # As modules do while they are imported: dataclasses execute texts. Only `python -m` asks for what Python noted.
    (tmp_path / "text.py").write_text(_TEXT, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    command = [sys.executable, "-m", "text"]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 130
    assert ended.stderr.count("interrupted") == 1


_MAP = """
import os, signal, sys, time
import robid.__main__
from robid import cli
from robid.backends.map import make_map
if __name__ == "__main__":
    def body(*_, **__):
        with make_map("processes", 2) as run:
            print(os.getpid(), flush=True)
            run(time.sleep, [30] * 4)
    cli._app_for = lambda _: body
    cli.main()
"""


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
@pytest.mark.parametrize("wait_s", [0.02, 1.5])
def test_a_group_that_is_ended_says_so_once_and_leaves_nothing(tmp_path, sent, code, wait_s):
    script = tmp_path / "map.py"
    script.write_text(_MAP, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, str(script)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    with process:
        process.stdout.readline()
        time.sleep(wait_s)
        os.killpg(process.pid, sent)
        # The pipe ends when the last of its group has ended.
        _, err = process.communicate(timeout=20)
    assert process.returncode == code
    assert err.decode().strip().splitlines() == [line for line in err.decode().splitlines() if "interrupted; " in line]

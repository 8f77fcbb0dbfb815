"""The map on a scheduler that others have started: what is checked first, and what is lost with it."""

import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
from distributed.utils import LoopRunner

import backend_tasks
from dask_cluster import Cluster, cluster, wait_for
from robid.backends.dask import cluster as connecting
from robid.backends.dask import worker
from robid.backends.dask import worker as checks
from robid.backends.dask.exchange import shared_folder
from robid.backends.map import make_map
from robid.errors import BackendError, RobidError, SettingsError


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("cluster")) as made:
        made.worker()
        yield made


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Machines that run many tests at once answer late."""
    monkeypatch.setattr(connecting, "_CONNECT_S", 90)


def refused(address: str, folder: Path) -> BackendError:
    """Tries to use a scheduler, which must fail with an exit code of 3 and leave nothing."""
    with pytest.raises(BackendError) as caught, make_map("dask", 1, scheduler=address, folder=folder):
        pass
    assert caught.value.exit_code == 3
    assert "docs/how-to/clusters.md" in caught.value.remedy
    assert list(folder.glob(".dask-*")) == []
    return caught.value


def test_tasks_run_there_in_the_folder_of_the_command(
    shared: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("1 2 3")
    with make_map("dask", 1, scheduler=shared.address, folder=Path("runs/small")) as ordered:
        assert ordered(backend_tasks.read_and_wait, ["log.csv"]) == ["1 2 3"]
        assert ordered(backend_tasks.blas_threads, [0])[0]
        assert {*ordered(backend_tasks.blas_threads, [0])[0]} == {1}
    assert list(Path("runs/small").iterdir()) == []


def test_a_scheduler_that_does_not_answer_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connecting, "_CONNECT_S", 1)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        free.listen()
        deaf = refused(address, tmp_path)
    error = refused(address, tmp_path)
    for each in (deaf, error):
        assert each.what == "B004 The scheduler does not answer within 1 s."
        assert each.where == address


def test_an_address_that_is_none_is_a_settings_error(tmp_path: Path) -> None:
    with (
        pytest.raises(SettingsError, match="S001"),
        make_map("dask", 1, scheduler="http://10.0.0.1:8786", folder=tmp_path),
    ):
        pass


@pytest.mark.parametrize("address", ["http://10.0.0.1:8786", "tcp://127.0.0.1:1"])
def test_what_a_refused_address_leaves_keeps_no_other_client_from_starting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    """The garbage collector may come to it while the next client starts, which holds a lock of them all."""
    monkeypatch.setattr(connecting, "_CONNECT_S", 1)
    gc.collect()
    gc.disable()
    try:
        with pytest.raises(RobidError), make_map("dask", 1, scheduler=address, folder=tmp_path):
            pass
        collecting = threading.Thread(target=gc.collect, daemon=True)
        with LoopRunner._lock:
            collecting.start()
            collecting.join(timeout=20)
            assert not collecting.is_alive()
    finally:
        gc.enable()


def test_a_scheduler_without_workers_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "WAIT_FOR_WORKERS_S", 0.5)
    with cluster(tmp_path) as alone:
        error = refused(alone.address, tmp_path)
    assert "no workers" in error.what
    assert f"dask worker {alone.address} --nthreads 1" in error.remedy


def test_workers_that_do_not_see_the_folder_are_named(
    shared: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def other_folder(*terms: object) -> worker.Terms:
        return worker.Terms(*terms[:3], "another token")

    monkeypatch.setattr(connecting, "Terms", other_folder)
    error = refused(shared.address, tmp_path)
    assert "1 of 1 workers cannot be used: tcp://127.0.0.1:" in error.what
    assert f"does not see {tmp_path}" in error.what
    assert "--run-dir" in error.remedy


def test_workers_of_other_versions_are_named(shared: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = dict(worker.versions_here())
    monkeypatch.setattr(connecting, "versions_here", lambda: tuple({**here, "numpy": "1.0"}.items()))
    error = refused(shared.address, tmp_path)
    assert f"has numpy {here['numpy']} instead of 1.0" in error.what
    assert "the environment of this command" in error.remedy


def test_versions_that_keep_both_from_understanding_each_other_are_told_first() -> None:
    ours = {"packages": {"python": "3.11.7.final.0", "dask": "1", "distributed": "1", "cloudpickle": "3"}}
    theirs = {"packages": {"python": "3.12.1.final.0", "dask": "1", "distributed": "2"}}
    alike = {"packages": {**ours["packages"], "python": "3.11.2.final.0"}}
    assert checks._language(ours, alike) == ""
    told = "python 3.12 instead of 3.11, distributed 2 instead of 1, cloudpickle (missing) instead of 3"
    assert checks._language(ours, theirs) == told


def test_a_scheduler_without_robid_is_told() -> None:
    class Lacks:
        def run_on_scheduler(self, _: object) -> None:
            raise Exception("ModuleNotFoundError(\"No module named 'robid'\")")  # noqa: TRY002  as distributed raises it

    with pytest.raises(BackendError, match="The scheduler cannot import robid") as caught:
        checks._check_scheduler(Lacks(), "tcp://a:1")
    assert "environment of this command" in caught.value.remedy


def test_a_worker_of_several_threads_is_named(tmp_path: Path) -> None:
    terms = worker.Terms(worker.versions_here(), str(tmp_path), str(tmp_path), "token")
    (tmp_path / "token").write_text("token")

    def complaint(threads: int) -> worker.Complaint | None:
        return worker.examine(terms, SimpleNamespace(state=SimpleNamespace(nthreads=threads)))

    assert complaint(1) is None
    assert complaint(4) == worker.Complaint(worker.THREADS, "has 4 threads")


def test_a_worker_that_does_not_see_what_the_tasks_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("token")
    here = worker.versions_here(), str(tmp_path), str(tmp_path), "token", None
    alone = SimpleNamespace(state=SimpleNamespace(nthreads=1))
    assert worker.examine(worker.Terms(*here, (str(tmp_path),)), alone) is None
    found = worker.examine(worker.Terms(*here, (str(tmp_path), "/nowhere/logs")), alone)
    assert found == worker.Complaint(worker.INPUTS, "does not see /nowhere/logs")
    error = checks.refusal("tcp://a:1", found)
    assert "tcp://a:1 does not see /nowhere/logs" in error.what
    assert "manifest, experiment file and data" in error.remedy


@pytest.mark.parametrize("data", ["/the/commands", None])
def test_tasks_read_the_data_folder_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, data: str | None
) -> None:
    monkeypatch.setenv("ROBID_DATA", "/the/workers")
    alone = SimpleNamespace(address="tcp://a:1", state=SimpleNamespace(nthreads=1))
    monkeypatch.setattr(worker, "get_worker", lambda: alone)
    monkeypatch.setattr(worker, "_limit_threads", lambda: None)
    with shared_folder(tmp_path) as exchange:
        terms = worker.Terms(worker.versions_here(), str(tmp_path), str(exchange.folder), exchange.token, data)
        packed, _ = exchange.packer().pack(os.getenv, "ROBID_DATA")
        assert worker.perform(terms, 0, packed) == worker.Done(data)
    assert os.environ["ROBID_DATA"] == "/the/workers"


def test_the_command_sends_its_data_folder_and_what_its_tasks_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[worker.Terms] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROBID_DATA", "data")
    monkeypatch.setattr(connecting, "_remote", lambda _: nullcontext())
    monkeypatch.setattr(connecting, "check_cluster", lambda _client, _address, terms: sent.append(terms))
    with make_map("dask", 1, scheduler="tcp://a:1", folder=tmp_path, inputs=(Path("floor"), Path("floor"))):
        pass
    assert [(terms.data, terms.inputs) for terms in sent] == [("data", (str(tmp_path / "floor"),))]


_NO_ROBID = """
import sys
class Refuse:
    def find_spec(self, name, *_):
        if name.split(".")[0] == "robid":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Refuse())
"""


def test_workers_without_robid_are_named_and_so_is_one_that_joins_later_and_may_not(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(_NO_ROBID)
    with cluster(tmp_path) as made:
        without = made.worker(first=str(tmp_path))
        error = refused(made.address, tmp_path / "run")
        assert "1 of 1 workers cannot be used" in error.what
        assert "cannot import robid" in error.what
        without.kill()
        without.wait()
        made.worker()
        (tmp_path / "log").write_text("1")
        with make_map("dask", 1, scheduler=made.address, folder=tmp_path / "run") as ordered:
            made.worker("--nthreads", "2")
            with pytest.raises(BackendError, match=r"joined later cannot be used: tcp.* has 2 threads") as caught:
                ordered(backend_tasks.read_and_wait, [str(tmp_path / "log")] * 300)
        assert "--nthreads 1" in caught.value.remedy
        assert "the same command goes on" in caught.value.remedy


_CLIENT = """
import sys
from pathlib import Path
import backend_tasks
from robid.backends.map import make_map
if __name__ == "__main__":
    with make_map("dask", 1, scheduler=sys.argv[1], folder=Path(sys.argv[2])) as ordered:
        ordered(backend_tasks.touch_slowly, [f"{sys.argv[2]}/{index}" for index in range(2000)])
"""


def test_tasks_of_a_killed_client_are_dropped(shared: Cluster, tmp_path: Path) -> None:
    script = tmp_path / "client.py"
    script.write_text(_CLIENT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    client = subprocess.Popen([sys.executable, str(script), shared.address, str(tmp_path)], env=environment)
    wait_for((tmp_path / "0").exists)
    client.send_signal(signal.SIGKILL)
    client.wait()
    assert len(list(tmp_path.glob(".dask-*"))) == 1
    with make_map("dask", 1, scheduler=shared.address, folder=tmp_path) as ordered:
        assert len(list(tmp_path.glob(".dask-*"))) == 1
        assert ordered(backend_tasks.slow_first, range(3)) == [0, 1, 4]
        done = len(list(tmp_path.glob("[0-9]*")))
        time.sleep(0.5)
        assert len(list(tmp_path.glob("[0-9]*"))) == done < 100


def test_a_scheduler_that_is_killed_ends_in_one_message(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    paths = [str(tmp_path / f"{index}.done") for index in range(500)]
    with cluster(tmp_path) as made:
        made.worker()
        began: list[float] = []

        def kill(*_: object) -> None:
            if not began:
                began.append(time.monotonic())
                threading.Timer(0.3, made.scheduler.kill).start()

        with (
            pytest.raises(BackendError, match=r"The scheduler was lost; \d+ of 500 tasks were done\.") as caught,
            make_map("dask", 1, scheduler=made.address, folder=tmp_path / "run") as ordered,
        ):
            ordered(backend_tasks.touch_slowly, paths, kill)
        assert time.monotonic() - began[0] < 10
    assert caught.value.exit_code == 3
    assert "what is finished is kept; the same command goes on once the scheduler is back" in caught.value.remedy
    assert "".join(capfd.readouterr()) == ""

"""The commands on Dask: the same content, and one message where it cannot be used."""

import importlib.util

import pytest

from robid import errors
from robid.backends.dask import cluster as connecting


def test_dask_gives_the_content_of_the_other_backends(done):
    answer = done.robid("run", "small.yaml", "--run-dir", "other", "--backend", "dask", "--workers", "2")
    assert answer.code == 0, answer.err
    assert done.contents(done.folder / "other") == done.contents()
    told = [line for line in answer.err.splitlines() if not line.startswith("warning: Predicts")]
    assert all("made:" in line for line in told[1:])
    assert list((done.folder / "other").glob(".dask*")) == []


def test_a_fresh_run_needs_no_workers(done, monkeypatch):
    monkeypatch.setattr(connecting, "LocalCluster", None)
    answer = done.robid("run", "small.yaml", "--backend", "dask", "--json")
    assert answer.code == 0
    assert {node["outcome"] for node in answer.json["nodes"]} == {"fresh"}


def test_a_fresh_run_removes_what_a_killed_one_left(done):
    left = done.runs / ".dask-0123"
    left.mkdir()
    (left / "lock").touch()
    assert done.robid("run", "small.yaml", "--backend", "dask").code == 0
    assert not left.exists()


@pytest.mark.parametrize("command", ["run", "study", "simulate-or-acquire"])
def test_without_the_extra_every_command_says_how_to_install_it(shop, monkeypatch, command):
    found = importlib.util.find_spec
    monkeypatch.setattr(errors, "find_spec", lambda name: None if name == "distributed" else found(name))
    shop.refuse(2, "pip install 'robid[dask]'", command=(command, "small.yaml", "--backend", "dask"))


def test_a_scheduler_belongs_to_dask(shop):
    command = ("run", "small.yaml", "--scheduler", "tcp://10.0.0.1:8786")
    shop.refuse(2, "S015 the backend serial has no scheduler", "add `--backend dask`", command=command)


def test_a_scheduler_that_does_not_answer_is_told_before_anything_is_made(shop, monkeypatch):
    monkeypatch.setattr(connecting, "_CONNECT_S", 0.3)
    command = ("run", "small.yaml", "--backend", "dask", "--scheduler", "tcp://127.0.0.1:9")
    shop.refuse(3, "tcp://127.0.0.1:9: B004", command=command)

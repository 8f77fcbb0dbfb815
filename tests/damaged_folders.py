"""The folders that cases of `damage` spoil: made once, by robid itself."""

import contextlib
import shutil
from pathlib import Path

import damage
from fleet_floor import Floor

STAGES = Path(__file__).parent / "stages"


class _Shop:
    """What a floor needs of a workshop."""

    def __init__(self, folder):
        self.folder = folder

    def robid(self, *arguments):
        return damage.robid(*arguments)


def make_small(folder):
    copy_small(folder)
    with contextlib.chdir(folder):
        assert damage.robid("run", "small.yaml")[0] == 0


def make_fleet(folder):
    floor = Floor(_Shop(folder))
    floor.start({"soft": 0.9, "hard": 1.1})
    with contextlib.chdir(folder):
        assert floor.robid()[0] == 0


def make_logs(folder):
    experiment = (STAGES / "fleet.yaml").read_text(encoding="utf-8")
    damage.write_logs(folder, damage.readable(), experiment, STAGES / "bench_robot.yaml")


def make_responses(folder):
    make_small(folder)
    damage.write_responses(folder)


def copy_small(folder):
    for name in ("arm.yaml", "small.yaml"):
        shutil.copy(STAGES / name, folder)


MAKERS = {
    "settings": copy_small,
    "command": copy_small,
    "artifact": make_small,
    "chain": make_small,
    "fleet": make_fleet,
    "log": make_logs,
    "response": make_responses,
}


def made_once(new_folder):
    """Returns what gives the folder that a case damages, made when it is first asked for."""
    folders = {}

    def make(case):
        maker = MAKERS[case]
        if maker not in folders:
            folders[maker] = new_folder(case)
            maker(folders[maker])
        return folders[maker]

    return make

import pytest

from robid.artifacts.artifact import Dataset
from robid.errors import DataError
from robid.studies.study import Task, run_tasks
from task_functions import CALLS, Told, map_in_order, square


def squares(*numbers, version=1):
    return [Task(f"square_{number}", {"number": number, "version": version}, (number,)) for number in numbers]


def values(results):
    return [int(result.datasets["square"].values) for result in results]


@pytest.fixture(autouse=True)
def _forget_calls():
    CALLS.clear()


def run(folder, tasks, **further):
    return values(run_tasks(folder, square, tasks, map_in_order, Told(), **further))


def test_each_task_is_done_once_and_in_order(tmp_path):
    assert run(tmp_path, squares(3, 1)) == [9, 1]
    assert run(tmp_path, squares(1, 2, 3)) == [1, 4, 9]
    assert CALLS == [3, 1, 2]
    assert run(tmp_path, squares(1, 2, 3), force=True) == [1, 4, 9]
    assert CALLS == [3, 1, 2, 1, 2, 3]


def test_what_is_done_survives_a_failure_and_is_told(tmp_path):
    with pytest.raises(DataError):
        run(tmp_path, squares(2, -1, 3))
    assert CALLS == [2, -1]
    told = Told()
    assert values(run_tasks(tmp_path, square, squares(2, 3), map_in_order, told)) == [4, 9]
    assert CALLS == [2, -1, 3]
    assert told.expected == (2, "tasks", 1)
    assert told.advanced == 1


def test_a_damaged_result_is_made_again(tmp_path):
    run(tmp_path, squares(2))
    (path,) = tmp_path.glob("*.h5")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert run(tmp_path, squares(2)) == [4]
    assert CALLS == [2, 2]


def test_results_of_other_settings_go_only_once_all_are_done(tmp_path):
    run(tmp_path, squares(2, 3))
    with pytest.raises(DataError):
        run(tmp_path, squares(2, -1, version=2))
    assert run(tmp_path, squares(2, 3)) == [4, 9]
    assert CALLS == [2, 3, 2, -1]
    run(tmp_path, squares(2, version=2))
    assert len(list(tmp_path.glob("*.h5"))) == 1


def test_datasets_come_back_as_they_went(tmp_path):
    (result,) = run_tasks(tmp_path, square, squares(5), map_in_order, Told())
    assert isinstance(result.datasets["square"], Dataset)
    assert result.datasets["square"].units == "m^2"
    assert result.provenance.settings == {"number": 5, "version": 1}

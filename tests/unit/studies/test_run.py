"""What a study says of itself."""

from types import SimpleNamespace

from robid.studies.run import _of_several_commits


def made_at(*commits):
    return [SimpleNamespace(git_commit=commit) for commit in commits]


def test_results_of_several_commits_are_told():
    one, other = "a" * 40, "b" * 40
    assert _of_several_commits([made_at(one, one), made_at(one)]) == ()
    (told,) = _of_several_commits([made_at(one), made_at(f"{one}+", other, "")])
    assert "none, aaaaaaaa, aaaaaaaa+, bbbbbbbb." in told
    assert "`--force`" in told

"""Parts of a run in its folder.

Of this run, undamaged, each in its place, or made again.
"""

import pytest

from fourbar.errors import DependencyError
from fourbar_validation.run.store import RunningError, Store


def fill(folder, identity, *tasks):
    """Leave the parts of an interrupted run."""
    with Store(folder, {"suite": identity}).held() as store:
        for task in tasks:
            store.put(task, [{"task": task}])
    return folder / "parts"


def list_done(folder, identity):
    with Store(folder, {"suite": identity}).held() as store:
        return store.done(), [note.rpartition(": ")[2] for note in store.notes]


def test_a_run_goes_on_from_its_own_parts(tmp_path):
    fill(tmp_path, "one", 0, 2)
    assert list_done(tmp_path, "one") == ({0, 2}, [])
    with Store(tmp_path, {"suite": "one"}).held() as store:
        assert store.read(2) == [{"task": 2}]


def test_the_parts_of_another_run_are_not_taken(tmp_path):
    fill(tmp_path, "one", 0, 1)
    done, notes = list_done(tmp_path, "two")
    assert done == set()
    assert notes == ["the parts of another run (suite)"]


def test_a_part_that_came_from_another_run_is_not_taken(tmp_path):
    parts = fill(tmp_path / "here", "one", 0)
    (foreign := fill(tmp_path / "there", "two", 1) / "000001").rename(parts / "000001")
    assert not foreign.exists()
    assert list_done(tmp_path / "here", "one") == ({0}, ["is of another run"])


def test_a_part_in_the_place_of_another_is_not_taken(tmp_path):
    parts = fill(tmp_path, "one", 0)
    (parts / "000000").rename(parts / "000003")
    assert list_done(tmp_path, "one") == (set(), ["is another part"])


@pytest.mark.parametrize("place", (0.5, 0.99))
def test_a_part_with_a_damaged_byte_is_not_taken(place, tmp_path):
    part = fill(tmp_path, "one", 0) / "000000"
    written = bytearray(part.read_bytes())
    written[int(place * len(written))] ^= 1
    part.write_bytes(written)
    with Store(tmp_path, {"suite": "one"}).held() as store:
        with pytest.raises(DependencyError, match="is damaged"):
            store.read(0)
        assert store.done() == set() and not part.exists()


def test_a_folder_has_one_run_at_a_time(tmp_path):
    with Store(tmp_path, {"suite": "one"}).held(), pytest.raises(RunningError):
        fill(tmp_path, "one", 0)

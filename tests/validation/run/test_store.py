"""Parts of a run in its folder.

Of this run, undamaged, each in its place, or made again.
"""

from pytest import mark, raises

from fourbar.errors import DependencyError, InputError
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


WRONG_PARTS = {"is of another run", "is another part", "is no file"}


def test_only_a_part_of_this_run_in_its_place_is_taken(tmp_path):
    parts = fill(
        tmp_path / "here",
        "one",
        0,
        2,
    )
    foreign = fill(tmp_path / "there", "two", 1) / "000001"
    foreign.rename(parts / "000001")
    (parts / "000002").rename(parts / "000003")
    for junk in ("another", ".000000.part", "000007"):
        (parts / junk / "inner").mkdir(parents=True)
    done, notes = list_done(tmp_path / "here", "one")
    assert done == {0} and {*notes} == WRONG_PARTS
    done, notes = list_done(tmp_path / "here", "two")
    assert done == set() and notes == ["the parts of another run (suite)"]
    assert not [*parts.iterdir()]


@mark.parametrize("place", (0.5, 0.99))
def test_a_part_with_a_damaged_byte_is_not_taken(place, tmp_path):
    part = fill(tmp_path, "one", 0) / "000000"
    written = bytearray(part.read_bytes())
    written[int(place * len(written))] ^= 1
    part.write_bytes(written)
    with Store(tmp_path, {"suite": "one"}).held() as store:
        with raises(DependencyError, match="is damaged"):
            store.read(0)
        assert store.done() == set() and not part.exists()


def test_a_folder_has_one_run_at_a_time_and_keeps_parts_in_a_folder(tmp_path):
    with Store(tmp_path, {"suite": "one"}).held(), raises(RunningError):
        fill(tmp_path, "one", 0)
    (tmp_path / "parts").rmdir()
    (tmp_path / "parts").write_text("a file")
    words = "must be a folder, in which a run keeps its parts"
    with raises(InputError, match=words):
        fill(tmp_path, "one", 0)

"""A file that is written again keeps its mode and its links, and its bytes where
writing fails.
"""

import os
import stat

from pytest import mark, raises

from fourbar import InputError
from fourbar.writing import write_bytes

pytestmark = mark.posix


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@mark.parametrize("before", [0o600, 0o640, 0o664, 0o755], ids=oct)
def test_an_existing_file_keeps_its_mode_and_a_new_one_is_an_ordinary_file(
    tmp_path, before
):
    path = tmp_path / "a"
    write_bytes(path, b"new")
    umask = os.umask(0)
    os.umask(umask)
    assert mode(path) == 0o666 & ~umask
    path.chmod(before)
    write_bytes(path, b"again")
    assert (mode(path), path.read_bytes()) == (before, b"again")
    write_bytes(path, b"private", private=True)
    assert mode(path) == 0o600


def test_a_symbolic_link_stays_and_the_file_that_it_names_is_written(tmp_path):
    (tmp_path / "far").mkdir()
    real, link, chain = tmp_path / "far" / "real", tmp_path / "link", tmp_path / "chain"
    link.symlink_to("far/real")
    chain.symlink_to(link)
    write_bytes(link, b"through a link that names no file yet")
    real.chmod(0o600)
    write_bytes(chain, b"through two")
    assert chain.is_symlink() and link.is_symlink() and not real.is_symlink()
    assert (real.read_bytes(), mode(real)) == (b"through two", 0o600)
    assert [file.name for file in (tmp_path / "far").iterdir()] == ["real"]
    (tmp_path / "round").symlink_to("round")
    with raises((OSError, InputError)):
        write_bytes(tmp_path / "round", b"")
    (tmp_path / "nowhere").symlink_to("no/such/folder")
    with raises(InputError, match="no such folder"):
        write_bytes(tmp_path / "nowhere", b"")

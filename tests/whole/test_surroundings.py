"""A clock that jumps, a user who may write nowhere, and tables made to harm."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pytest import fixture, mark, skip

from fourbar.errors import BROKEN, HOLDS, LONGEST_MESSAGE, InputError
from fourbar_validation.regression.record import ACCEPTED, find_baseline, open_run
from tests.support.checkout import ROOT, run_line

MUTATIONS = int(os.environ.get("MUTATIONS", "40"))


@fixture
def locked():
    """A folder that its user may read and not write, with a scene."""
    folder = Path(tempfile.mkdtemp())
    shutil.copy(ROOT / "models/crank_rocker.toml", folder / "scene.toml")
    folder.chmod(0o555)
    yield folder
    folder.chmod(0o755)
    shutil.rmtree(folder)


@mark.slow
@mark.posix
@mark.parametrize(
    "line, ends",
    [
        ("fourbar analyze scene.toml", HOLDS),
        ("fourbar analyze scene.toml --csv -o a.csv", BROKEN),
        ("fourbar plot scene.toml --figure linkage -o a.svg", BROKEN),
        ("fourbar mjcf scene.toml -o scene.xml", BROKEN),
        ("fourbar_validation run scene.toml --engines free-body -o out", BROKEN),
    ],
)
def test_a_user_who_may_write_nowhere_gets_numbers_or_one_line(locked, line, ends):
    """Nor at home, where libraries keep their caches."""
    environment = os.environ | {"HOME": str(locked), "PYTHONDONTWRITEBYTECODE": "1"}
    rights = []
    if os.geteuid() == 0:  # to whom no folder is locked, but by this
        if shutil.which("setpriv") is None:
            skip("root has all rights, and setpriv takes none away")
        rights = ["setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner"]
    done = run_line(
        [*rights, sys.executable, "-m", *line.split()],
        locked,
        env=environment,
        stdin=subprocess.DEVNULL,
        timeout=100,
    )
    assert done.returncode == ends, done.stderr
    if ends == HOLDS:
        assert "torque" in done.stdout and done.stderr == ""
    else:
        assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
        assert len(done.stderr) <= LONGEST_MESSAGE
    assert [path.name for path in locked.iterdir()] == ["scene.toml"]


def damage(table, rng):
    """Turn bits, cut, or write over the footer of a parquet file."""
    kind = rng.integers(4)
    changed = bytearray(table)
    footer = int.from_bytes(table[-8:-4], "little")
    if kind == 0:
        for place in rng.integers(len(changed), size=rng.integers(1, 9)):
            changed[place] ^= 1 << rng.integers(8)
    elif kind == 1:
        changed = changed[: rng.integers(len(changed))]
    elif kind == 2:
        for place in rng.integers(footer, size=4):
            changed[-9 - place] = rng.integers(256)
    else:
        changed[-8:-4] = rng.bytes(4)
    return bytes(changed)


@mark.slow
@mark.linux
def test_a_damaged_table_is_refused_or_read(tmp_path):
    """Each in a process of its own, which a fault of the reader would end."""
    table = (find_baseline(ACCEPTED) / "results.parquet").read_bytes()
    rng = np.random.default_rng(3)
    statuses = []
    for _ in range(MUTATIONS):
        (tmp_path / "results.parquet").write_bytes(damage(table, rng))
        child = os.fork()
        if child == 0:
            try:
                list(open_run(tmp_path).rows())
                os._exit(0)
            except InputError:
                os._exit(2)
            except BaseException:
                os._exit(9)
        statuses.append(os.waitpid(child, 0)[1])
    assert {os.waitstatus_to_exitcode(status) for status in statuses} == {0, 2}

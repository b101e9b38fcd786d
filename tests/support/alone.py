"""Commands in processes forked from one that has loaded the libraries and nothing of
the project.

What a command must import by itself shows as in a process of its own, without the
second that numpy and pint take.
"""

import os
import runpy
import sys
from multiprocessing import get_context

LIBRARIES = ["numpy", "click", "rich.table", "pint", "mpmath", "pyarrow.parquet"]
TIME = 60.0
"""s; a command that takes longer has failed."""
CLEAN = get_context("forkserver")
CLEAN.set_forkserver_preload(LIBRARIES)


def become(program, line, folder):
    """`python -m program line` in a folder, with what it prints in two files there."""
    assert not {name.partition(".")[0] for name in sys.modules} & {
        "fourbar",
        "fourbar_validation",
    }
    for number, name in ((1, "printed"), (2, "complained")):
        os.dup2(os.open(folder / name, os.O_CREAT | os.O_WRONLY), number)
    os.chdir(folder)
    sys.argv = [program, *line]
    runpy.run_module(program, run_name="__main__", alter_sys=True)


def alone(program, line, folder):
    """The status of a command, and what it complained of."""
    process = CLEAN.Process(target=become, args=(program, line, folder))
    process.start()
    process.join(TIME)
    process.kill()
    return process.exitcode, (folder / "complained").read_text()

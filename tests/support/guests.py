"""Programs that answer as guests, made of the engine of docs/protocol.md, and the
processes of a test.
"""

import io
import json
import os
import re
import shlex
import sys
from pathlib import Path

import pytest

from fourbar_validation import engine
from fourbar_validation.engines import guests, programs
from tests.support.checkout import read
from tests.support.texts import put

(PLAIN,) = re.findall(r"```python\n(.*?)```", read("docs/protocol.md"), re.DOTALL)
"""The page's engine in plain Python."""


def write_program(folder, name, *words):
    """Write the page's engine under a name, with other words: each old, then new."""
    text = put(PLAIN, '"plain"', repr(name), *words)
    file = folder / f"{name.replace(' ', '_')}.py"
    file.write_text(text, "utf-8")
    return shlex.join([sys.executable, "-I", "-S", str(file)])


class Hosted(programs.Running):
    """A class or adapter that our host serves in this process; programs run as ever."""

    def _ask(self, question, positions):
        if "fourbar_validation.engine" not in self.program.command:
            return super()._ask(question, positions)
        self._number += 1
        line = json.dumps({"id": self._number, **question}, allow_nan=False)
        said = io.BytesIO()
        engine.serve(self.program.command[-1], io.BytesIO(line.encode()), said)
        return self._read(said.getvalue())


@pytest.fixture
def hosted(monkeypatch):
    """Serves classes in this process: all but what a process of their own is for."""
    monkeypatch.setattr(guests, "Running", Hosted)
    monkeypatch.setattr(engine, "_hash_code", lambda module: "")


def end_guests():
    """End the programs that this process started."""
    for running in guests._RUNNING.values():
        running.end()
    guests._RUNNING.clear()


def list_processes(mark):
    """List the processes whose environment has the mark."""
    processes = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    processes.append(int(entry.name))
            except OSError:
                continue
    return processes

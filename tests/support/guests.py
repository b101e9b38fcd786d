"""Programs that answer as guests, made of the engine of docs/protocol.md, and the
processes of a test.
"""

import os
import re
import shlex
import sys
from pathlib import Path

from fourbar_validation.engines import guests
from tests.whole.test_imports import ROOT

PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
(PLAIN,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
"""The page's engine in plain Python."""


def write_program(folder: Path, name: str, *replacements: tuple[str, str]) -> str:
    text = PLAIN.replace('"plain"', repr(name))
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    file = folder / f"{name.replace(' ', '_')}.py"
    file.write_text(text, encoding="utf-8")
    return shlex.join([sys.executable, "-I", "-S", str(file)])


def end_guests() -> None:
    """End the programs that this process started."""
    for running in guests._RUNNING.values():
        running.end()
    guests._RUNNING.clear()


def list_processes(mark: str) -> list[int]:
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

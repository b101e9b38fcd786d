"""The present state judged by MuJoCo and Pinocchio: the harness, where it is installed, in a process of its own."""

import asyncio
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fourbar.errors import DependencyError, say_install
from fourbar.writing import write_text

CHECKOUT = Path(__file__).parents[2]
HARNESS = "fourbar_validation"
SHOWN = 30
"""Lines of what the harness prints."""
TICK = 0.5
"""s, between two reports of progress."""


def find_harness() -> list[str]:
    """Return the command of the harness: installed, or of this checkout; DependencyError where there is none."""
    engines = all(importlib.util.find_spec(name) for name in ("mujoco", "pinocchio"))
    if engines and importlib.util.find_spec(HARNESS):
        return [sys.executable, "-m", HARNESS]
    if engines and (CHECKOUT / "validation" / "__main__.py").is_file():
        return [sys.executable, "-m", "validation"]
    raise DependencyError(f"the harness with MuJoCo and Pinocchio is not installed: {say_install('validation')}")


class HarnessRun:
    """One run of the harness at a time, with its progress."""

    def __init__(self, folder: Path, tell: Callable[[dict[str, Any]], None]) -> None:
        self.folder, self.tell = folder, tell
        self.process: asyncio.subprocess.Process | None = None
        self.task: asyncio.Task[None] | None = None

    @property
    def report(self) -> Path:
        """Where the report of the last run stands."""
        return self.folder / "report.html"

    def start(self, text: str) -> None:
        """Begin to judge a scene; one that runs already goes on."""
        if self.task is None or self.task.done():
            self.task = asyncio.create_task(self._run(text))

    def stop(self) -> None:
        """End the process and all that it started."""
        if self.process is not None and self.process.returncode is None:
            if os.name == "posix":
                os.killpg(self.process.pid, signal.SIGTERM)
            else:
                self.process.terminate()

    async def _run(self, text: str) -> None:
        began, lines = time.monotonic(), list[str]()

        def report(**more: Any) -> None:
            self.tell({"check": {"seconds": time.monotonic() - began, "lines": lines[:SHOWN], **more}})

        try:
            command = find_harness()
            self.folder.mkdir(parents=True, exist_ok=True)
            self.report.unlink(missing_ok=True)
            scene = self.folder / "scene.toml"
            write_text(scene, text)
            self.process = await asyncio.create_subprocess_exec(
                *(*command, "run", str(scene.absolute()), "--out", str(self.folder.absolute())),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                cwd=CHECKOUT if command[-1] == "validation" else None,
                start_new_session=True,  # so that it ends with all that it starts
            )
            assert self.process.stdout is not None
            reading = asyncio.create_task(self._read(self.process.stdout, lines))
            while not (await asyncio.wait({reading}, timeout=TICK))[0]:
                report(running=True)
            status = await self.process.wait()
            report(running=False, stopped=status < 0, status=status, report=self.report.exists())
        except (DependencyError, OSError) as error:
            lines[:] = [str(error)]
            report(running=False, report=False)

    @staticmethod
    async def _read(stream: asyncio.StreamReader, lines: list[str]) -> None:
        while line := await stream.readline():
            if "\u2501" not in (text := line.decode(errors="replace").rstrip()):  # no bars of progress
                lines.append(text)

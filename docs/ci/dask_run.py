"""Judge a run on a Dask cluster: dask_run.py SCHEDULER PARTS DIR [options of run]."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from distributed import Client, as_completed

from fourbar_validation.report.machine import name_code


def judge(part: str, code: dict[str, str], options: list[str]) -> bytes:
    """Judge one part on a worker; return its folder, packed."""
    assert name_code() == code, "this worker has other versions or code of fourbar"
    program = [sys.executable, "-m", "fourbar_validation", "run", "--workers", "1"]
    with tempfile.TemporaryDirectory() as folder:
        judged = Path(folder, "part")
        line = [*program, *options, "--part", part, "--out", str(judged)]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
        return Path(shutil.make_archive(str(judged), "zip", judged)).read_bytes()


def unpack(packed: bytes, folder: Path) -> None:
    """Unpack a part beside its place, so that its folder appears whole or never."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as beside:
        archive = Path(beside, "part.zip")
        archive.write_bytes(packed)
        shutil.unpack_archive(archive, Path(beside, "part"))
        Path(beside, "part").rename(folder)


if __name__ == "__main__":
    scheduler, parts, out, *options = sys.argv[1:]
    Path(out).mkdir(parents=True, exist_ok=True)
    folders = {f"{k + 1}/{parts}": Path(out, str(k + 1)) for k in range(int(parts))}
    with Client(scheduler) as client:
        wanted = [part for part, folder in folders.items() if not folder.exists()]
        tasks = client.map(judge, wanted, code=name_code(), options=options, retries=3)
        for task, packed in as_completed(tasks, with_results=True):
            unpack(packed, folders[wanted[tasks.index(task)]])
    collect = [sys.executable, "-m", "fourbar_validation", "collect", "--out", out]
    sys.exit(subprocess.call([*collect, *folders.values()]))

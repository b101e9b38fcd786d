"""Judge a run on a Dask cluster: dask_run.py SCHEDULER PARTS DIR [options of run]."""

import io
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from distributed import Client, as_completed

from fourbar_validation.report.machine import name_code


def judge(part: str, code: dict[str, str], options: list[str]) -> bytes:
    """Judge one part on a worker; return its folder, packed."""
    assert name_code() == code, "this worker has other versions or code of fourbar"
    program = [sys.executable, "-m", "fourbar_validation", "run", "--workers", "1"]
    with tempfile.TemporaryDirectory() as folder:
        line = [*program, *options, "--part", part, "--out", folder]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr)
        packed = io.BytesIO()
        with tarfile.open(fileobj=packed, mode="w") as tar:
            tar.add(folder, ".")
    return packed.getvalue()


if __name__ == "__main__":
    scheduler, parts, out, *options = sys.argv[1:]
    folders = {f"{k + 1}/{parts}": Path(out, str(k + 1)) for k in range(int(parts))}
    with Client(scheduler) as client:
        wanted = [part for part, folder in folders.items() if not folder.exists()]
        tasks = client.map(judge, wanted, code=name_code(), options=options, retries=3)
        for task, packed in as_completed(tasks, with_results=True):
            with tarfile.open(fileobj=io.BytesIO(packed)) as tar:
                tar.extractall(folders[wanted[tasks.index(task)]], filter="data")
    collect = [sys.executable, "-m", "fourbar_validation", "collect", "--out", out]
    sys.exit(subprocess.call([*collect, *folders.values()]))

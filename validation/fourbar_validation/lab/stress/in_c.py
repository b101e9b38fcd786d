"""The formulas as a loop in C, compiled on the spot."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Loop = Callable[[Array, Array], None]
"""Writes theta_3, theta_4, omega_3, omega_4, alpha_3, alpha_4, F12, F32, F43, F14 (two rows each) and the torque at n
angles into an array (15, n)."""
SOURCE = Path(__file__).with_name("bench_loop.c")
FLAGS = ("-O3", "-march=native")


def compile_loop() -> Loop | str:
    """Compile the loop; the reason where that fails."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "no C compiler is installed"
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        line = [compiler, *FLAGS, "-fPIC", "-shared", str(SOURCE), "-o", str(library), "-lm"]
        made = subprocess.run(line, capture_output=True, encoding="utf-8", errors="replace", check=False)
        if made.returncode != 0:
            return f"{compiler} fails: {(made.stderr.strip().splitlines() or ['without a word'])[0]}"
        loop = ctypes.CDLL(str(library)).loop
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(theta_2: Array, out: Array) -> None:
        loop(ctypes.c_long(len(theta_2)), theta_2.ctypes.data_as(pointer), out.ctypes.data_as(pointer))

    return call

"""The formulas as a loop in C, compiled on the spot: plain, and with the vector math library of the C library."""

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
PLAIN = ("-O3", "-march=native")
VECTOR = (*PLAIN, "-ffast-math", "-fno-builtin-sin", "-fno-builtin-cos")
"""Sine and cosine as one call of sincos would keep GCC from taking several positions at once."""
CALLED = b"_ZGV"
"""How the names of vector functions begin (the vector ABI of x86-64 and of Arm)."""


def c_loop(flags: tuple[str, ...] = PLAIN) -> Loop | str:
    """The loop, or the reason why there is none."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "no C compiler is installed"
    with tempfile.TemporaryDirectory() as folder:
        loop_o, library = Path(folder) / "loop.o", Path(folder) / "loop.so"
        # linked without the flags: with -ffast-math a library takes subnormal numbers from the process that loads it
        for line in (
            [compiler, *flags, "-fPIC", "-c", str(SOURCE), "-o", str(loop_o)],
            [compiler, "-shared", str(loop_o), "-o", str(library), "-lm"],
        ):
            made = subprocess.run(line, capture_output=True, text=True, check=False)
            if made.returncode != 0:
                return f"{compiler} fails: {(made.stderr.strip().splitlines() or ['without a word'])[0]}"
        if flags == VECTOR and CALLED not in library.read_bytes():
            return f"{compiler} finds no vector math library (glibc's libmvec is one)"
        loop = ctypes.CDLL(str(library)).loop
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(theta_2: Array, out: Array) -> None:
        loop(ctypes.c_long(len(theta_2)), theta_2.ctypes.data_as(pointer), out.ctypes.data_as(pointer))

    return call

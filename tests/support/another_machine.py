"""Other machines that this one can pass for.

`test_machines.py` starts the tests there, the one below first.
"""

import os
from functools import cache
from typing import NamedTuple

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from fourbar_validation.report.machine import find_blas
from tests.support.checkout import run_python

BEFORE = "MACHINE_BEFORE"
"""The environment variable that tells the child what its parent calculates with."""


class Core(NamedTuple):
    """A kernel of OpenBLAS, by the name that OPENBLAS_CORETYPE takes.

    The CPU it is made for belongs to it.
    """

    needs: str
    """The feature without which its instructions are illegal."""
    lacks: tuple
    """Beginnings of NumPy's names for what such a CPU has not; "" is all of them."""
    tunables: str = ""
    """The same for the sine of the GNU C library."""


AVX512 = ("X86_V4", "AVX512")
NO_FMA = "glibc.cpu.hwcaps=-AVX2,-FMA"
CORES = {
    "Haswell": Core("AVX2", AVX512),
    "Prescott": Core("SSE3", ("",), NO_FMA),
    "Nehalem": Core("SSE42", ("",), NO_FMA),
    "Zen": Core("AVX2", AVX512),
    "SkylakeX": Core("AVX512_SKX", ()),
}
"""The commonest first."""


def here():
    """What this process calculates with.

    The BLAS kernel of NumPy and the vectorised functions of NumPy.
    """
    return " ".join(
        [
            find_blas() or "unknown BLAS",
            *(name for name in __cpu_dispatch__ if __cpu_features__[name]),
        ]
    )


def environment(core):
    """The variables under which OpenBLAS takes this CPU for another.

    NumPy and the C library follow them too.
    """
    off = [
        name
        for name in __cpu_dispatch__
        if __cpu_features__[name] and name.startswith(CORES[core].lacks)
    ]
    blas_and_numpy = {
        "OPENBLAS_CORETYPE": core,
        "NPY_DISABLE_CPU_FEATURES": " ".join(off),
    }
    return blas_and_numpy | {"GLIBC_TUNABLES": CORES[core].tunables}


@cache
def machine(core=None):
    """Return what a fresh process calculates with, under the variables of a core if one
    is named.
    """
    code = f"from {__name__} import here; print(here())"
    done = run_python("-c", code, **({} if core is None else environment(core)))
    return done.stdout.strip()


def why_not(core):
    """Why nothing is to be learned from a core here, or None."""
    if not __cpu_features__.get(CORES[core].needs):
        return f"this CPU has no {CORES[core].needs}"
    if machine(core) == machine():
        return "it is what this process calculates with"
    before = list(CORES)[: list(CORES).index(core)]
    twin = next(
        (
            core_before
            for core_before in before
            if why_not(core_before) is None and machine(core_before) == machine(core)
        ),
        None,
    )
    return twin and f"the same as {twin} here"


def test_this_is_another_machine():
    assert here() != os.environ[BEFORE]

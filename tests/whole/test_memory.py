"""Memory and processor time of long sweeps, looked at from outside the process."""

import re

import numpy as np
from pytest import mark

import fourbar
from fourbar.errors import HOLDS
from fourbar.scene import command
from fourbar.show import motion_curves
from fourbar.solving import solve
from tests.support.checkout import ROOT, read, run_python

MOST_MEMORY, MOST_TIME = 600, 8.0
"""MB, s: what `analyze` of a million positions may take. The arrays of its solution are
400 MB, and their evaluation with error bars takes 4 s.
"""
BUSY = 2.0
"""Factor of processor time on cores that others use too."""
ANALYZE_AND_LOOK = """
import re, sys, time
from fourbar.cli import main
try:
    main()
except SystemExit as ended:
    status = ended.code
used = open("/proc/self/status").read()
peak = re.search(r"VmHWM:\\s+([0-9]+) kB", used)[1]
print(status or 0, peak, time.process_time(), file=sys.stderr)
"""
"""The command, and its own peak of memory: that of a process that `wait4` tells has the
memory of the process that started it in it.
"""


@mark.slow
@mark.linux
def test_analyze_of_a_million_positions_needs_little_beyond_them(tmp_path):
    scene = tmp_path / "million.toml"
    text = read("models/crank_rocker.toml")
    longer, steps = re.subn(r"steps = \d+", "steps = 999998", text)
    assert steps == 1
    scene.write_text(longer, "utf-8")
    done = run_python("-c", ANALYZE_AND_LOOK, "analyze", scene)
    status, peak, seconds = done.stderr.split()
    assert int(status) == HOLDS
    assert int(peak) / 1024 < MOST_MEMORY
    assert float(seconds) < BUSY * MOST_TIME


@mark.parametrize("name", ["crank_rocker", "capabilities/springs"])
def test_bending_is_the_same_in_blocks(name, monkeypatch):
    scene = fourbar.load(ROOT / f"models/{name}.toml")
    solution = solve(scene, at=command(scene))
    whole = motion_curves.compute_bending(solution)
    monkeypatch.setattr(motion_curves, "POSITIONS_OF_A_BLOCK", 7)
    in_blocks = motion_curves.compute_bending(solution)
    for bar, bending in whole.items():
        np.testing.assert_array_equal(in_blocks[bar].moment, bending.moment)
        np.testing.assert_array_equal(in_blocks[bar].x, bending.x)

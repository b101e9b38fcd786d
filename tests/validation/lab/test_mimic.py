"""What a mimic joint loses, measured: the loop loses nothing, the torque is wrong by what `ratio` states."""

from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.studies.ratio import ratio
from fourbar_validation.cli import status
from fourbar_validation.lab.mimic import simulate_lost
from tests.whole.test_imports import ROOT

BONNET = ROOT / "models" / "gallery" / "bonnet_hinge.toml"


def test_the_simulations_lose_what_the_formulas_state() -> None:
    scene = fourbar.load(ROOT / "models" / "crank_rocker.toml")
    gear, (loop, best, one) = ratio(scene), simulate_lost(scene)
    assert max(loop.parts.values()) < 1e-6 and loop.angle < 1e-6 and set(loop.parts) > {"F43"}
    for fit, found in ((gear.fits[3], best), (gear.fits[0], one)):
        assert "F43" not in found.parts
        assert found.angle == pytest.approx(fit.angle.value, rel=0.05)
        assert found.parts["torque"] == pytest.approx(fit.torque.value / np.abs(gear.torque).max(), rel=0.05)
        assert min(found.parts[name] for name in ("F12", "F32", "F14")) > 0.1
    bonnet = fourbar.load(BONNET)  # where the joints have yet to settle they are wrong by five times as much
    gear, (_, best, _) = ratio(bonnet), simulate_lost(bonnet)
    assert best.parts["torque"] == pytest.approx(gear.fits[3].torque.value / np.abs(gear.torque).max(), rel=0.1)


def test_the_command_writes_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "mimic.md"
    assert status(["cost", "--mimic", str(BONNET), "-o", str(out)]) == 0
    text, kept = out.read_text(), (ROOT / "docs" / "examples" / "mimic.md").read_text()
    about = text.partition("| scene")[0]
    assert about == kept.partition("| scene")[0] and text.count("| bonnet\\_hinge |") == 3
    capsys.readouterr()
    still = tmp_path / "still.toml"
    still.write_text(BONNET.read_text().replace('omega_2 = "-20 deg/s"', 'omega_2 = "0 deg/s"'))
    assert status(["cost", "--mimic", str(still)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "motion.omega_2" in error and "still.toml" in error

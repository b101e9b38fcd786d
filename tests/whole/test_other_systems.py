"""Other systems.

No `fork`, an ASCII locale, names with blanks and accents, line ends of Windows. Workers
are started by `spawn` everywhere; here nothing else can be had. What opens a text
without saying its encoding makes Python warn.
"""

from dataclasses import replace

from pytest import fixture, mark

from fourbar import load
from fourbar.cli import status
from fourbar.errors import HOLDS
from fourbar.files import save
from fourbar_validation.cli import status as harness
from tests.support.checkout import ROOT, join_paths, run_python

pytestmark = mark.slow
HOSTILE = {
    "LC_ALL": "C",
    "PYTHONUTF8": "0",
    "PYTHONCOERCECLOCALE": "0",
    "PYTHONIOENCODING": "",
}
OURS = [str(ROOT / "fourbar"), str(ROOT / "validation")]
BEGIN = (
    "import os, sys; vars(os).pop('fork', None); from {module} import status;"
    " sys.exit(status(sys.argv[1:]))"
)


@fixture
def folder(tmp_path):
    """A folder whose name takes more than ASCII, with a scene whose title does."""
    scene_folder = tmp_path / "Análisis de θ"
    scene_folder.mkdir()
    model = load(ROOT / "models" / "crank_rocker.toml")
    linkage = replace(model.linkage, output=replace(model.linkage.output, mass=0.36))
    scene = replace(model, linkage=linkage, title="Mécanique, θ₂", source="")
    save(scene, scene_folder / "scène.toml")
    return scene_folder


@mark.parametrize(
    "module, line",
    [
        ("fourbar.cli", "analyze scène.toml --csv -o table.csv"),
        ("fourbar.cli", "analyze scène.toml --json"),
        ("fourbar.cli", "mjcf scène.toml -o model.xml"),
        ("fourbar.cli", "animate scène.toml -o page.html"),
        ("fourbar.cli", "plot scène.toml --figure linkage -o plot.svg"),
        (
            "fourbar_validation.cli",
            "run scène.toml --workers 1 --engines free-body --out results",
        ),
        ("fourbar_validation.cli", "check-mjcf scène.toml {models}/crank_rocker.xml"),
    ],
)
def test_commands_need_neither_fork_nor_utf_8(module, line, folder):
    words = ["-X", "warn_default_encoding", "-c", BEGIN.format(module=module)]
    words += line.format(models=ROOT / "models").split()
    done = run_python(*words, folder=folder, PYTHONPATH=join_paths(), **HOSTILE)
    # a bar of the model of `check-mjcf` is heavier
    assert done.returncode == ("check-mjcf" in line), done.stderr
    assert not [
        line
        for line in done.stderr.splitlines()
        if "EncodingWarning" in line and line.startswith(tuple(OURS))
    ]


def test_line_ends_of_windows_are_read(folder, capsys):
    scene, table = folder / "scène.toml", folder / "table.csv"
    assert status(["analyze", str(scene), "--csv", "-o", str(table)]) == HOLDS
    before = load(scene)
    for file in (scene, table):
        assert b"\r" not in file.read_bytes()
        file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert load(scene) == before
    capsys.readouterr()
    assert harness(["check", str(scene), str(table)]) == HOLDS
    assert "numbers agree" in capsys.readouterr().out

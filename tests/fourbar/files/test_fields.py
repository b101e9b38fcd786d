"""An effect of one file is read, written, varied, drawn and dragged by its fields."""

import sys
from cmath import rect
from dataclasses import replace

from pytest import approx, fixture, mark

from fourbar import Place, effects, solve, vary
from fourbar.edit.dragging import list_handles
from fourbar.edit.scene_entries import list_offers
from fourbar.files import dump, loads
from fourbar.scene.numbers import find_unit_of_key
from fourbar.show.plot.symbols import list_acting
from fourbar.studies.keys import list_entries, read_number
from tests.support.rows import read_rows, refused

FILE = '''
from dataclasses import dataclass
from typing import Annotated, ClassVar

from fourbar.effects.effect import Effect
from fourbar.effects.place import At, Line, Place
from fourbar.linkage import AT_LEAST_ZERO, Declared, Entries, OfBar, OneOf


@dataclass(frozen=True, slots=True)
class Magnet(Line):
    """A force between two places."""

    start: Annotated[Place, At("from")]
    end: Annotated[Place, At("to")]
    pull: Annotated[float, Declared("N", AT_LEAST_ZERO)]
    pole: Annotated[str, OneOf(("north", "south"))] = "north"


@dataclass(frozen=True, slots=True)
class Magnets(Effect):
    """Magnets, and a coil at a place of a bar."""

    bar: Annotated[int, OfBar((2, 4))]
    turns: Annotated[float, Declared("1")]
    coil: Annotated[Place, At()]
    gap: Annotated[float, Declared("m")] = 0.001
    rows: Annotated[tuple[Magnet, ...], Entries(Magnet)] = ()
    key: ClassVar[str] = "magnets"
    example: ClassVar[str] = (
        'magnets = { bar = 2, turns = 3.0, coil = { bar = 3 } }'
    )

    def act(self, actions, state):
        for row in self.rows:
            across = row.end.locate(state) - row.start.locate(state)
            actions.pull(row.start, row.end, row.pull * across / abs(across))
'''
TEXT = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[motion]
theta_2 = "60 deg"
omega_2 = "1 rad/s"
[points]
P = { bar = 4, from_pin = ["2 cm", "0 deg"] }
[effects.magnets]
bar = 4
turns = 12.0
gap = "2 mm"
coil = { bar = 3, from_pin = ["5 cm", "0.5 rad"] }
[[effects.magnets.rows]]
from = { point = "P" }
to = { bar = 1 }
pull = "2 lbf"
[[effects.magnets.rows]]
from = { bar = 2 }
to = { bar = 3, from_centre = ["1 cm", "0 deg"] }
pull = "3 N"
pole = "south"
"""


@fixture
def kind(monkeypatch, tmp_path):
    (tmp_path / "magnets.py").write_text(FILE, encoding="utf-8")
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    for cached in (effects.list_classes, list_offers):
        cached.cache_clear()
    yield effects.Magnets
    for cached in (effects.list_classes, list_offers):
        cached.cache_clear()
    sys.modules.pop("fourbar.effects.magnets")
    del effects.Magnets


@fixture
def scene(kind):
    return loads(TEXT)


def test_it_is_read_and_written(scene):
    (magnets,) = scene.effects
    assert (magnets.bar, magnets.turns, magnets.gap) == (4, 12.0, 0.002)
    assert magnets.coil == Place(3, (0.05, 0.5))
    first, second = magnets.rows
    assert (first.pull, first.pole) == (2.0 * 4.4482216152605, "north")
    assert first.start == Place(4, point="P")
    assert first.end == Place(1, (0.0, 0.0))
    assert (second.pull, second.pole) == (3.0, "south")
    assert loads(dump(scene)).effects == scene.effects
    without = replace(scene, effects=(replace(magnets, rows=()),))
    assert loads(dump(without)).effects == without.effects
    assert list_offers()["words"]["pole"] == ["north", "south"]


@mark.parametrize(
    "old, new, line",
    read_rows(r"""
bar = 4\nturns | bar = 3\nturns | magnets.bar = 3: must be 2 (in
"2 mm" | 2 | effects.magnets.gap = 2: the unit is missing
turns = 12.0 |  | effects.magnets.turns: is missing
gap = | gab = | magnets.gab = '2 mm': unknown key
"2 lbf" | "-2 lbf" | rows[0].pull = '-2 lbf': must be a fini
"south" | "west" | rows[1].pole = 'west': must be "north" o
to = { bar = 1 } | to = { bar = 4 } | magnets.rows[0].to.bar = 4: mu
from_centre | at | rows[1].to.at = [
"""),
)
def test_a_mistake_is_named_with_its_key(kind, old, new, line):
    old, new = (text.replace(r"\n", "\n") for text in (old, new))
    assert TEXT.count(old) == 1
    with refused(line):
        loads(TEXT.replace(old, new))


NUMBERS = read_rows("""
turns | 12 | 1
gap | 0.002 | m
coil.from_pin.0 | 0.05 | m
coil.from_pin.1 | 0.5 | rad
rows.0.pull | 8.896443230521 | N
rows.0.to.from_pin.0 | 0 | m
rows.0.to.from_pin.1 | 0 | rad
rows.1.pull | 3 | N
rows.1.from.from_pin.0 | 0 | m
rows.1.from.from_pin.1 | 0 | rad
rows.1.to.from_centre.0 | 0.01 | m
rows.1.to.from_centre.1 | 0 | rad
""")
"""Keys of the magnets, and what the file states."""


def test_its_numbers_vary_by_their_keys(scene):
    entries = list_entries(scene).items()
    of_magnets = {key: entry for key, entry in entries if key.startswith("effects.")}
    assert of_magnets.keys() == {f"effects.magnets.{name}" for name, *_ in NUMBERS}
    for name, value, unit in NUMBERS:
        key = f"effects.magnets.{name}"
        assert read_number(scene, of_magnets[key]) == approx(float(value), rel=1e-15)
        assert of_magnets[key].unit == find_unit_of_key(key) == unit
    key = "effects.magnets.rows.1.pull"
    three, four, six = solve(vary(scene, {key: [3.0, 4.0, 6.0]})).torque.ravel()
    assert three == solve(scene).torque != four
    assert six - four == approx(2.0 * (four - three), rel=1e-12)


def test_its_places_are_handles_and_symbols(scene):
    handles = {handle.name: handle for handle in list_handles(scene)}
    assert handles.keys() == {
        "point P",
        "coil of magnets",
        *(f"{end} of magnets rows {row}" for row in (1, 2) for end in ("from", "to")),
    }
    coil = handles["coil of magnets"]
    assert coil.path == ("effects", "magnets", "coil", "from_pin")
    assert (coil.bar, coil.beyond) == (3, rect(0.05, 0.5))
    point = handles["from of magnets rows 1"]
    assert (point.path, point.bar) == (("points", "P", "from_pin"), 4)
    far = handles["to of magnets rows 2"].path
    assert far == ("effects", "magnets", "rows", 1, "to", "from_centre")
    _, *acting = list_acting(scene)
    assert [(symbol.kind, symbol.name, symbol.pin) for symbol in acting] == [
        ("magnets", "magnets", "O4"),
        ("magnets", "magnets", ""),
        ("spring", "magnet", ""),
        ("spring", "magnet", ""),
    ]
    assert (acting[1].bar, acting[1].at) == (3, rect(0.05, 0.5))
    assert acting[2].end == (1, 0.0)

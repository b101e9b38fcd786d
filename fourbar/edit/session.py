"""A scene that is being changed: its text, its history and its kept states."""

import base64
import json
import os
import secrets
import tomllib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from itertools import count, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourbar.edit.dragging import (
    Dragged,
    drag,
    list_handles,
    put_number,
    put_place,
    write_rounded,
)
from fourbar.edit.exports import (
    EXPORT_ENDINGS,
    evaluate_scene,
    list_peaks,
    write_export,
)
from fourbar.edit.scene_entries import KeyPath, SceneDocument, list_offers
from fourbar.errors import FourBarError, InputError, state_messages_in
from fourbar.files import parse_tables, read_scene_text, read_tables
from fourbar.files.fields import Entry, SceneFile, split_key
from fourbar.files.new_scene import write_drawn_scene, write_new_scene
from fourbar.files.scene_file import LARGEST_SCENE_FILE
from fourbar.linkage import PINS, POSITIVE, Declared
from fourbar.quantities.units import find_unit, to_si
from fourbar.scene import Scene
from fourbar.scene.motion import (
    BRANCH_OF_NAME,
    COMMAND_NAMES,
    SIDES,
    STROKE_COMMAND,
    require_steps,
)
from fourbar.scene.pictures import TracedPicture
from fourbar.show.shown_units import find_length, units, units_of_scene
from fourbar.show.summary import Facts
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.solving import solve
from fourbar.studies.keys import list_entries, read_number
from fourbar.writing import read_bytes, write_bytes

EDIT_SCHEMA = "fourbar-edit/2"
MOST_STATES = 500
"""Number of states that undo and redo reach."""
MOST_KEPT = 20
"""Number of states that are kept to compare with, the one at the start among them."""
MOST_SOLVED_ANEW = 100_000
"""Largest number of positions that are solved anew on a change, in a second. A mistyped
step count must not fill the memory.
"""
NEW = ("300 mm", "100 mm", "250 mm", "220 mm")
"""Ground, input, coupler and output of a new scene."""
_AS_THE_FILE = "as the file"
"""Units of results that follow those of lengths.ground."""
OFFERED_UNITS = (
    _AS_THE_FILE,
    "SI",
    "imperial",
    "mm N N.mm deg",
    "mm N N.m deg rpm",
    "cm N N.cm deg rpm",
    "in lbf lbf.ft deg rpm",
)
"""Units of results to choose from; any other list can be typed."""


_STORED = {
    "disk": "disk",
    "texts": "texts",
    "place": "history_index",
    "kept": "kept",
    "reference": "reference",
    "units": "unit_names",
    "pressure": "pressure_text",
}
"""Entries of the state file, and the attributes of a session that they hold."""
_ENDING_OF_PICTURE = {
    "data:image/png": "png",
    "data:image/jpeg": "jpg",
    "data:image/svg+xml": "svg",
}
Asked = dict[str, Any]
"""Request of a page, or a part of the answer to it."""
LARGEST_STATE = 100_000_000
"""Bytes of a state file."""


class SceneState(NamedTuple):
    """A scene file that can be read, and what was read."""

    text: str
    scene: Scene
    plain: Asked

    @property
    def units(self) -> Conversion:
        """Units of the file, in which messages state numbers too."""
        return units_of_scene(self.plain)

    def evaluate(self, units: Conversion, **more: Any) -> Asked:
        """Evaluate the scene for the page, as `evaluate_scene` does."""
        with state_messages_in(self.units):
            return evaluate_scene(self.scene, units, **more)


class Session:
    """The scene file at `path`, changed step by step.

    A change that is refused leaves the last good state.
    """

    def __init__(self, path: Path, exports: Path) -> None:
        self.path = Path(os.path.realpath(path))
        self.exports = exports
        self.stem = path.stem
        self.state_file = self.path.with_name(self.path.name + ".edit")
        self.token = secrets.token_urlsafe(32)  # of this process alone
        self.unit_names = _AS_THE_FILE
        self.pressure_text = ""
        self.disk = self._read_disk()
        text = write_new_scene(NEW)
        self.placeholder = tomllib.loads(text) | {"picture": None}
        """What a new scene states that stands for nothing yet."""
        if self.disk is not None:
            text = read_scene_text(self.path)
        self.texts = [text]
        self.history_index = 0
        self.kept = {"start": text}
        self.reference = "start"
        self.gesture = ""
        if self.state_file.exists():
            self._resume()
        else:
            self.now = self.read(text)
        self.document = SceneDocument(self.now.text)
        self.base = self.now

    def _resume(self) -> None:
        """Go on where an earlier session stopped."""
        data = read_bytes(self.state_file, "state file", LARGEST_STATE)
        try:
            state = {"pressure": ""} | json.loads(data)
            if state["schema"] != EDIT_SCHEMA:
                raise ValueError(f"schema {str(state['schema'])[:60]!r}")
            for key, name in _STORED.items():
                setattr(self, name, state[key])
            _find_chosen_units(self.unit_names)
            _read_pressure(self.pressure_text)
            if self.history_index < 0 or self.reference not in self.kept:
                raise ValueError("it names a state that it does not hold")
            self.now = self.read(self.texts[self.history_index])
        except Exception as error:  # whatever stands in it
            allowed = (
                f"cannot be read as a state of the workbench ({error}): remove it to"
                " begin from the scene file"
            )
            raise InputError("state file", str(self.state_file), allowed) from None

    def write_state_file(self) -> None:
        """Write the state file, readable by its owner alone as the scene may be."""
        state = {"schema": EDIT_SCHEMA}
        state |= {key: getattr(self, name) for key, name in _STORED.items()}
        data = json.dumps(state, ensure_ascii=False).encode()
        write_bytes(self.state_file, data, private=True)

    def end(self, *, gone: bool) -> None:
        """Remove the state file if all is saved or nothing was changed; else write it.

        `gone`: no page is left. The state file is kept while one is.
        """
        if gone and (self.saved or len(self.texts) == 1):
            self.state_file.unlink(missing_ok=True)
        else:
            self.write_state_file()

    @property
    def units(self) -> Conversion:
        """Units of results: as chosen, or those of the file."""
        chosen = _find_chosen_units(self.unit_names)
        return self.now.units if chosen is None else chosen

    @property
    def pressure(self) -> float | None:
        """Pressure of the cylinder, Pa; None where none is stated."""
        return _read_pressure(self.pressure_text)

    @property
    def fresh(self) -> bool:
        """Return True if nothing is stated yet but a picture to trace.

        A page then shows an empty drawing.
        """
        stated = self.now.plain | {"picture": None}
        return self.disk is None and stated == self.placeholder

    @property
    def saved(self) -> bool:
        """Return True if the file on the disk holds the present state."""
        return self._read_disk() == self.now.text

    def _read_disk(self) -> str | None:
        if not self.path.exists():
            return None
        data = read_bytes(self.path, "scene file", LARGEST_SCENE_FILE)
        return data.decode("utf-8-sig", errors="replace")

    def read(self, text: str) -> SceneState:
        """Read the text of a scene; InputError where the workbench takes none such."""
        if len(text.encode()) > LARGEST_SCENE_FILE:
            allowed = f"must not exceed {LARGEST_SCENE_FILE} bytes"
            raise InputError("scene file", len(text), allowed)
        path = str(self.path)
        plain = parse_tables(text, path)
        with state_messages_in(units_of_scene(plain)):
            scene = read_tables(plain, path)
            require_steps(scene.motion, MOST_SOLVED_ANEW, "in the workbench", path)
        return SceneState(text, scene, plain)

    # ---- what a page asks for ----

    def answer(self) -> Asked:
        """Describe the present state, without error bars and summary."""
        return self.describe(self.now.evaluate(self.units))

    def describe(self, data: Asked, *, settled: bool = False) -> Asked:
        """Describe the present state.

        `data`: its numbers. `settled`: with error bars and summary.
        """
        entries = list_entries(self.now.scene)
        saved = {"saved": self.saved} if settled else {}
        return {
            "data": data,
            "settled": settled,
            "plain": self.now.plain,
            "text": self.now.text,
            "units": self.unit_names,
            "pressure": self.pressure_text,
            "undo": self.history_index > 0,
            "redo": self.history_index + 1 < len(self.texts),
            "reference": self.reference,
            "changed": self.now.text != self.kept[self.reference],
            "kept": [*self.kept],
            "keys": {key: entry.unit for key, entry in entries.items()},
            "fresh": self.fresh,
            **saved,
        }

    def compared(self) -> Asked:
        """Describe the state that the present one is held against."""
        kept = self.read(self.kept[self.reference])
        return {"compared": self.reference, "data": kept.evaluate(self.units)}

    def locate_kept_peaks(self) -> dict[str, float | None]:
        """List the located peaks of the state that the present one is held against.

        None if it states one position: its curves go on over the whole range.
        """
        kept = solve(self.read(self.kept[self.reference]).scene)
        return list_peaks(kept, Facts(kept)) if len(kept) > 1 else {}

    def do(self, asked: Asked) -> Asked:
        """Do what a page asks for and describe the state after it.

        A request that is refused changes nothing.
        """
        before = (self.texts, self.history_index, self.now)
        try:
            parameters = dict(asked)
            parameters.pop("id", None)
            action = getattr(self, f"_do_{parameters.pop('do')}")
            with state_messages_in(self.now.units):
                note = action(**parameters) or {}
            return self.answer() | note
        # the server goes on after any error, also after a request without sense
        except Exception as error:
            self.texts, self.history_index, self.now = before
            self.document = SceneDocument(self.now.text)
            if isinstance(error, InputError):
                words = f"{error.key}: {error.allowed}"
            elif isinstance(error, FourBarError | OSError):
                words = str(error)
            else:
                words = f"this cannot be done: {error}"
            return {"refused": words, "text": self.now.text, "plain": self.now.plain}

    def change(self, alter: Callable[[SceneDocument], None], gesture: str = "") -> None:
        """Alter the document.

        Changes of one gesture begin from the same state and are one step to undo.
        """
        goes_on = bool(gesture) and gesture == self.gesture
        if not goes_on:
            self.base = self.now
        alter(self.document)
        now = self.read(self.document.text())
        if not goes_on and now.text != self.now.text:
            self.history_index += 1
            goes_on = True
        if goes_on:
            self.texts = [*self.texts[: self.history_index], now.text]
        forgotten = max(len(self.texts) - MOST_STATES, 0)
        self.texts = self.texts[forgotten:]
        self.history_index -= forgotten
        self.now = now
        self.gesture = gesture
        if not gesture:
            # entries that were put in then stand as in a file; too slow for each step
            self.document = SceneDocument(now.text)

    # ---- one method for each request that a page can make, by its parameters ----

    def _do_hello(self) -> Asked:
        """List what a page needs once: what it offers."""
        offers = list_offers() | {"units": OFFERED_UNITS}
        return {"offers": offers, "file": self.path.name, "refer": True}

    def _do_set(self, path: KeyPath, value: str, gesture: str = "") -> None:
        self.change(lambda document: document.set(path, value), gesture)

    def _do_add(self, part: int, name: str = "") -> None:
        offered = list_offers()["parts"][part]
        path = [step or name for step in offered["at"]]
        value = offered["value"]
        scene = self.now.scene
        entries = list_entries(scene)
        if path[0] == "tolerances" and name in entries:
            # a thousandth of the number, until the designer says more
            entry = entries[name]
            unit = find_unit(self.document.at(split_key(name)), entry.unit)
            number = float(read_number(scene, entry) or 1.0)
            number *= to_si(f"1 {entry.unit}", unit) / 1000.0
            value = f"{abs(number):.1g} {unit}"
        self.change(lambda document: document.put(path, value))

    def _do_remove(self, path: KeyPath) -> None:
        self.change(lambda document: document.remove(path))

    def _do_drag(self, to: tuple[float, float], gesture: str = "", **more: Any) -> None:
        dragged = Dragged(to=complex(*to), **more)

        def alter(document: SceneDocument) -> None:
            drag(document, self.base.scene, self.base.plain, dragged)

        self.change(alter, gesture)

    def _do_text(self, text: str) -> None:
        # refused in the words of the file's reader
        self.read(text)
        self.change(lambda document: document.become(text))

    def _do_undo(self, by: int = -1) -> None:
        index = self.history_index + by
        if not 0 <= index < len(self.texts):
            raise InputError("history", index, "no further state to undo or redo")
        self.now = self.read(self.texts[index])
        self.history_index = index
        self.gesture = ""
        self.document = SceneDocument(self.now.text)

    def _do_redo(self) -> None:
        self._do_undo(1)

    def _do_keep(self) -> Asked:
        *_, last = self.kept
        number = 0 if last == "start" else int(last.removeprefix("state "))
        name = f"state {number + 1}"
        self.kept[name] = self.now.text
        if len(self.kept) > MOST_KEPT:
            _, oldest, *_ = self.kept
            del self.kept[oldest]
        return self._do_refer(name)

    def _do_refer(self, to: str) -> Asked:
        if to not in self.kept:
            known = ", ".join(self.kept)
            raise InputError("reference", to, f"must be one of {known}")
        self.reference = to
        return {"refer": True}

    def _do_units(self, units: str) -> Asked:
        _find_chosen_units(units)
        self.unit_names = units
        return {"refer": True}

    def _do_pressure(self, pressure: str) -> None:
        _read_pressure(pressure)
        self.pressure_text = pressure.strip()

    def _do_command(self, command: str, theta_2: float | None = None) -> None:
        """Command another bar, or the cylinder.

        The range is what the present motion covers of it.
        """
        (names,) = (
            names
            for names in (*COMMAND_NAMES.values(), STROKE_COMMAND)
            if names[0] == command
        )
        now = self.now
        has_speed = now.scene.motion.speed is not None
        before = solve(now.scene, "force" if has_speed else "position")
        values = getattr(before, command)
        if values is None:
            reason = "needs a cylinder: add one in place of the bar first"
            raise InputError("command", command, reason)
        reached = np.unique(values[np.isfinite(values)])
        if len(reached) < 2:
            reason = "does not move in this motion: choose another sweep first"
            raise InputError("command", command, reason)
        first, last = reached[[0, -1]].tolist()
        from_middle = np.abs(values - 0.5 * (first + last))
        row = int(np.nanargmin(from_middle))
        if theta_2 is not None:
            away = np.exp(1j * before.theta_2) - np.exp(1j * theta_2)
            row = int(np.argmin(np.where(before.assembled, np.abs(away), np.inf)))

        document = SceneDocument(now.text)
        for name in now.plain["motion"].keys() - {"branch"}:
            document.remove(["motion", name])
        is_stroke = command == "stroke"
        si, unit, rate_unit = "rad", "deg", find_unit_in("rad/s", now.units)[0]
        if is_stroke:
            si, unit = "m", find_unit(find_length(now.plain), "m")
            rate_unit = f"{unit}/s"
        steps = max(60, min(len(before) - 1, 360))
        zero = f"0 {unit}"
        document.put(["motion", command], {"from": zero, "to": zero, "steps": steps})
        # so that rounding leads to no position beyond
        inset = 1e-3 * (last - first)
        for end, value in (("from", first + inset), ("to", last - inset)):
            put_number(document, ["motion", command, end], value, inset, si)
        if has_speed:
            # of the middle: where the bar turns back it is none
            rates = getattr(before, names[1])
            runs_alike = rates * rates[row] >= 0.0
            rate = float(rates[np.argmin(np.where(runs_alike, from_middle, np.inf))])
            of_rate = ["motion", names[1]]
            document.put(of_rate, f"0 {rate_unit}")
            put_number(document, of_rate, rate, abs(rate) / 100.0, f"{si}/s")
        text = self._choose_nearest_assembly(document, is_stroke, before, row)
        self.change(lambda changed: changed.become(text))

    def _choose_nearest_assembly(
        self, document: SceneDocument, has_side: bool, before: Solution, row: int
    ) -> str:
        """State the branch and the side whose motion passes nearest to a position."""
        pose = _list_directions(before)[:, [row]]
        # a drawing states the assembly by its pins, and refuses a branch beside them
        branches = [""] if document.at(["pins"]) is not None else list(BRANCH_OF_NAME)
        distances = dict[str, float]()
        for branch, side in product(branches, SIDES if has_side else [""]):
            for name, word in (("branch", branch), ("side", side)):
                if word:
                    document.put(["motion", name], word)
            text = document.text()
            after = _list_directions(solve(self.read(text).scene, "position"))
            away = np.abs(after - pose).sum(axis=0)
            distances[text] = float(np.min(np.nan_to_num(away, nan=np.inf)))
        return min(distances, key=distances.__getitem__)

    def _do_restate(self, path: KeyPath, by: str) -> None:
        """State a place by x and y, or by distance and angle."""
        places = {handle.path: handle.beyond for handle in list_handles(self.now.scene)}
        place = places[tuple(path)]
        grain = 1e-6 * abs(place)
        self.change(lambda document: put_place(document, path, place, grain, by))

    def _do_picture(self, data: str) -> Asked:
        """Keep a picture beside the scene, never over a file, under the drawing.

        `data`: its data URI.
        """
        kind, _, text = data.partition(";base64,")
        if kind not in _ENDING_OF_PICTURE:
            raise InputError("picture", kind[:40], "must be a PNG, JPEG or SVG picture")
        content = base64.b64decode(text, validate=True)
        folder = self.path.parent
        for number in count(1):
            mark = "" if number == 1 else f"-{number}"
            name = f"{self.path.stem}{mark}.{_ENDING_OF_PICTURE[kind]}"
            with suppress(FileExistsError), open(folder / name, "xb") as file:
                file.write(content)
                break
        try:
            TracedPicture(name, folder=str(folder)).read()
        except InputError:
            (folder / name).unlink()
            raise
        entries = {"file": name, "angle": "0 deg", "opacity": 0.5}
        self.change(lambda document: document.put(["picture"], entries))
        return {"note": f"the picture is {name}"}

    def _do_draw(
        self, pins: list[tuple[float, float]], unit: str, grain: float
    ) -> Asked:
        """State four pins in the plane, in a unit, in place of those of the file.

        The first drawing becomes the state at the start: it replaces no linkage of the
        user's.
        """
        written = {}
        for pin, (x, y) in zip(PINS, pins, strict=True):
            written_x = write_rounded(float(x), grain, unit)
            written[pin] = (written_x, write_rounded(float(y), grain, unit))
        is_first = self.fresh
        text = write_drawn_scene(written) if is_first else self.now.text
        picture = self.now.plain.get("picture")

        def alter(document: SceneDocument) -> None:
            document.become(text)
            for path in (["lengths"], ["motion", "branch"]):
                if document.at(path) is not None:
                    document.remove(path)
            for pin, place in written.items():
                document.put(["pins", pin], [*place])
            if is_first and picture is not None:
                document.put(["picture"], picture)

        self.change(alter)
        if is_first:
            self.kept["start"] = self.now.text
        return {"refer": is_first}

    def _do_save(self, over: bool = False) -> Asked:
        """Write the file; where it is another one than was read, only on demand."""
        name = self.path.name
        if self._read_disk() != self.disk and not over:
            if not self.path.exists():
                return {"ask": f"{name} was removed meanwhile. Write it again?"}
            return {"ask": f"{name} was changed on the disk meanwhile. Overwrite it?"}
        write_bytes(self.path, self.now.text.encode())
        self.disk = self.now.text
        return {"note": f"saved {name}", "saved": True}

    def _do_export(self, format: str) -> Asked:
        path = self.exports / f"{self.stem}.{EXPORT_ENDINGS[format]}"
        write_export(self.now.scene, path, format, self.units)
        return {"note": f"wrote {path}"}

    def _do_bodies(self, position: float) -> Asked:
        """Draw the free bodies at a position, as the address of a picture."""
        from fourbar.show.plot import draw_figure

        scene = self.now.scene
        drawn = draw_figure(scene, "freebody", position=position, units=self.units)
        data = base64.b64encode(drawn.render("svg")).decode()
        return {"bodies": f"data:image/svg+xml;base64,{data}"}


@cache
def _find_chosen_units(names: str) -> Conversion | None:
    """Return the chosen units of results; None if they are those of the file."""
    return None if names == _AS_THE_FILE else units(names)


def _read_pressure(text: str) -> float | None:
    """Return a pressure that is typed, Pa; None for an empty text.

    Raises InputError where it is none.
    """
    if not text.strip():
        return None
    entry = Entry(SceneFile("workbench"), "pressure", text)
    pressure: float = entry.check(Declared("Pa", POSITIVE))
    return pressure


def _list_directions(solution: Solution) -> Any:
    """Return the directions of the three moving bars at each position, (3, n)."""
    angles = solution.theta_2, solution.theta_3, solution.theta_4
    return np.exp(1j * np.array(angles))

"""One scene that is being changed: its text, its history, and what is kept of it next to the file."""

import hashlib
import json
import os
import secrets
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from fourbar.edit.document import SceneDocument, list_offers
from fourbar.edit.dragging import Dragged, drag
from fourbar.edit.exports import Exports
from fourbar.edit.reply import evaluate_scene
from fourbar.errors import FourBarError, InputError
from fourbar.files import loads, read_text
from fourbar.files.new import write_new_scene
from fourbar.files.reading import read_bytes
from fourbar.files.scene_file import LARGEST_FILE
from fourbar.scene import Scene
from fourbar.scene.motion import require_steps
from fourbar.show.units import units
from fourbar.solution import Conversion
from fourbar.studies.keys import list_entries, read_place
from fourbar.writing import write_bytes

SCHEMA = "fourbar-edit/2"
ENDING = ".edit"
MOST_STATES = 500
"""Number of states that undo and redo reach."""
MOST_CHARACTERS = 10_000_000
"""Characters of all these states; with those that are kept to compare they stay below `LARGEST_STATE` as JSON."""
MOST_KEPT = 20
"""Number of states that are kept to compare with, the one at the start among them."""
MOST_POSITIONS = 100_000
"""That a change solves anew, in a second; a slip of the finger on the number of steps is not to fill the memory."""
LARGEST_STATE = 100_000_000
"""Bytes of a state file."""
NEW = ("300 mm", "100 mm", "250 mm", "220 mm")
"""Ground, input, coupler and output of a new scene."""


class SceneState(NamedTuple):
    """A scene file that can be read, and what was read."""

    text: str
    scene: Scene
    plain: dict[str, Any]


class Session:
    """The scene file at `path`, changed step by step; whatever is refused leaves the last good state."""

    def __init__(self, path: Path, exports: Path) -> None:
        self.path, self.exports = Path(os.path.realpath(path)), Exports(exports, path.stem)
        self.state_file = self.path.with_name(self.path.name + ENDING)
        self.token = secrets.token_urlsafe(32)  # of this process alone
        self.unit_names, self.units = "SI", units("SI")
        text = read_text(self.path) if self.path.exists() else write_new_scene(NEW)
        self.disk = self._read_disk()
        self.texts, self.place, self.kept = [text], 0, {"start": text}
        self.reference, self.gesture = "start", ""
        if self.state_file.exists():
            self._resume()
        else:
            self.now = self._read(text)
        self.document = SceneDocument(self.now.text)
        self.base = self.now

    def _resume(self) -> None:
        """Go on where an earlier session stopped."""
        data = read_bytes(self.state_file, "state file", LARGEST_STATE)
        try:
            state = json.loads(data)
            if state["schema"] != SCHEMA:
                raise ValueError(f"schema {str(state['schema'])[:60]!r}")
            self.texts, self.place = [str(text) for text in state["texts"]], int(state["place"])
            self.kept = {str(name): str(text) for name, text in state["kept"].items()}
            self.reference, self.unit_names, self.disk = str(state["reference"]), str(state["units"]), state["disk"]
            self.units = units(self.unit_names)
            if self.place < 0 or self.reference not in self.kept:
                raise ValueError("it names a state that it does not hold")
            self.now = self._read(self.texts[self.place])
        except (
            ValueError,
            LookupError,
            TypeError,
            AttributeError,
            ArithmeticError,
            RecursionError,
            FourBarError,
        ) as error:
            allowed = f"is no state of the workbench ({error}): remove it to begin from the scene file"
            raise InputError("state file", str(self.state_file), allowed) from None

    def keep(self) -> None:
        """Write the state file, readable by its owner alone as the scene may be."""
        state = {
            **{"schema": SCHEMA, "disk": self.disk, "texts": self.texts, "place": self.place},
            **{"kept": self.kept, "reference": self.reference, "units": self.unit_names},
        }
        write_bytes(self.state_file, json.dumps(state, ensure_ascii=False).encode(), private=True)

    def end(self, *, gone: bool) -> None:
        """Take the state file away where all is saved, or nothing was changed, and no page is left (`gone`)."""
        if gone and (self.saved or len(self.texts) == 1):
            self.state_file.unlink(missing_ok=True)
        else:
            self.keep()

    @property
    def saved(self) -> bool:
        """Whether the file on the disk holds the present state."""
        return self._read_disk() == _hash_text(self.now.text.encode())

    def _read_disk(self) -> str | None:
        return _hash_text(read_bytes(self.path, "scene file", LARGEST_FILE)) if self.path.exists() else None

    def _read(self, text: str) -> SceneState:
        if len(text.encode()) > LARGEST_FILE:
            raise InputError("scene file", len(text), f"must not exceed {LARGEST_FILE} bytes")
        scene = loads(text, str(self.path))
        require_steps(scene.motion, MOST_POSITIONS, "in the workbench", str(self.path))
        return SceneState(text, scene, tomllib.loads(text))

    # ---- what a page asks for ----------------------------------------------------------------

    def answer(self) -> dict[str, Any]:
        """Describe the present state, without error bars and summary."""
        return self.describe(evaluate_scene(self.now.scene, self.now.plain, self.units))

    def describe(self, data: dict[str, Any], *, settled: bool = False) -> dict[str, Any]:
        """Describe the present state, whose numbers are `data`; `settled`: with error bars and summary."""
        return {
            "data": data,
            "settled": settled,
            "plain": self.now.plain,
            "text": self.now.text,
            "units": self.unit_names,
            "undo": self.place > 0,
            "redo": self.place + 1 < len(self.texts),
            "reference": self.reference,
            "kept": [*self.kept],
            "keys": {key: entry.unit for key, entry in list_entries(self.now.scene).items()},
            **({"saved": self.saved} if settled else {}),
        }

    def compared(self) -> dict[str, Any]:
        """Describe the state that the present one is held against."""
        kept = self._read(self.kept[self.reference])
        return {"compared": self.reference, "data": evaluate_scene(kept.scene, kept.plain, self.units)}

    def do(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Do what a page asks for and describe the state after it; what is refused changes nothing."""
        action = ACTIONS.get(str(asked.get("do")))
        before = (self.texts, self.place, self.now)
        try:
            if action is None:
                raise InputError("do", asked.get("do"), "must be one of " + ", ".join(ACTIONS))
            note = action(self, asked) or {}
            return self.answer() | note
        except Exception as error:  # of a page whose request makes no sense too: the server goes on
            self.texts, self.place, self.now = before
            self.document = SceneDocument(self.now.text)
            words = str(error) if isinstance(error, FourBarError | OSError) else f"this cannot be done: {error}"
            if isinstance(error, InputError):
                words = f"{error.key}: {error.allowed}"
            return {"refused": words, "text": self.now.text, "plain": self.now.plain}

    def change(self, alter: Callable[[SceneDocument], None], gesture: str = "") -> None:
        """Alter the document; what belongs to one gesture begins from the same state and is one step to undo."""
        goes_on = bool(gesture) and gesture == self.gesture
        if not goes_on:
            self.base = self.now
        alter(self.document)
        self._step_through_history(self._read(self.document.text()), goes_on)
        self.gesture = gesture

    def _step_through_history(self, now: SceneState, goes_on: bool) -> None:
        if goes_on:
            self.texts = [*self.texts[: self.place], now.text]
        elif now.text != self.now.text:
            self.texts = [*self.texts[: self.place + 1], now.text]
            self.place += 1
        while len(self.texts) > MOST_STATES or sum(map(len, self.texts)) > MOST_CHARACTERS:
            self.texts, self.place = self.texts[1:], self.place - 1
        self.now = now


def _hash_text(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _add(session: Session, asked: dict[str, Any]) -> None:
    part, name = list_offers()["parts"][int(asked["part"])], str(asked.get("name", ""))
    path = [name if step == "" else step for step in part["at"]]
    value = part["value"]
    if path[0] == "tolerances":
        known = list_entries(session.now.scene)
        if name in known:  # a thousandth of the number, until the designer says more
            size = abs(float(read_place(session.now.scene, known[name].place) or 1.0)) / 1000.0
            value = f"{size:.1g} {known[name].unit}"
    session.change(lambda of: of.put(path, value))
    session.document = SceneDocument(session.now.text)


def _remove(session: Session, asked: dict[str, Any]) -> None:
    session.change(lambda of: of.remove(asked["path"]))
    session.document = SceneDocument(session.now.text)


def _drag(session: Session, asked: dict[str, Any]) -> None:
    numbers = {name: float(asked[name]) for name in ("grain", "theta_2", "stretch") if name in asked}
    given = Dragged(asked["what"], complex(*map(float, asked["to"])), branch=int(asked["branch"]), **numbers)
    gesture = str(asked.get("gesture", ""))
    from_state = session.base if gesture and gesture == session.gesture else session.now
    session.change(lambda of: drag(of, from_state.scene, from_state.plain, given), gesture)


def _write_text(session: Session, asked: dict[str, Any]) -> None:
    now = session._read(str(asked["text"]))
    session._step_through_history(now, False)
    session.document, session.gesture = SceneDocument(now.text), ""


def _move(session: Session, by: int) -> None:
    place = session.place + by
    if not 0 <= place < len(session.texts):
        raise InputError("history", place, "there is nothing more to undo or redo")
    session.now, session.place, session.gesture = session._read(session.texts[place]), place, ""
    session.document = SceneDocument(session.now.text)


def _keep(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
    name = f"state {max((int(name.split()[1]) for name in session.kept if name != 'start'), default=0) + 1}"
    session.kept[name] = session.now.text
    if len(session.kept) > MOST_KEPT:
        del session.kept[next(name for name in session.kept if name != "start")]
    return _refer(session, {"to": name})


def _refer(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
    if asked["to"] not in session.kept:
        raise InputError("reference", asked["to"], "must be one of " + ", ".join(session.kept))
    session.reference = asked["to"]
    return {"refer": True}


def _list_units(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
    found: Conversion = units(str(asked["units"]))
    session.unit_names, session.units = str(asked["units"]), found
    return {"refer": True}


def _save(session: Session, asked: dict[str, Any]) -> dict[str, Any]:
    """Write the file; where it is another one than was read, only on demand."""
    if session._read_disk() != session.disk and not asked.get("over"):
        return {"ask": f"{session.path.name} was changed on the disk meanwhile. Overwrite it?"}
    data = session.now.text.encode()
    write_bytes(session.path, data)
    session.disk = _hash_text(data)
    return {"note": f"saved {session.path.name}", "saved": True}


ACTIONS: dict[str, Callable[[Session, dict[str, Any]], dict[str, Any] | None]] = {
    "set": lambda session, asked: session.change(
        lambda of: of.set(asked["path"], str(asked["value"])), str(asked.get("gesture", ""))
    ),
    "add": _add,
    "remove": _remove,
    "drag": _drag,
    "text": _write_text,
    "undo": lambda session, asked: _move(session, -1),
    "redo": lambda session, asked: _move(session, 1),
    "keep": _keep,
    "refer": _refer,
    "units": _list_units,
    "save": _save,
    "export": lambda session, asked: {
        "note": f"wrote {session.exports.write(session.now.scene, str(asked['format']), session.units)}"
    },
    "bodies": lambda session, asked: {
        "bodies": session.exports.free_bodies(session.now.scene, float(asked["position"]), session.units)
    },
    "hello": lambda session, asked: {"offers": list_offers(), "file": session.path.name, "refer": True},
}
"""What a page can ask for."""

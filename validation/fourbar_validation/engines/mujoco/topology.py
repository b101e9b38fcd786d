"""The four-bar in somebody's compiled MJCF: its bars, its pins, and its closure.

Any cut is understood: three of the pins are hinges, the fourth is an equality (connect,
weld) or two sites by name. The plane may be any.
"""

import math
from collections.abc import Mapping, Sequence
from copy import copy
from itertools import permutations
from typing import NamedTuple, NoReturn

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, ENDS, MOVING_BARS, PINS
from fourbar.mjcf import Plane
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import find_ends

_PIN_OF = {frozenset(bars): pin for pin, bars in PINS.items()}
_PLANES = {
    2: ("x-y", (0, 1)),
    1: ("x-z", (0, 2)),
    0: ("y-z", (1, 2)),
}
"""World axis of the hinges: the plane, and the world axes for x and y there."""
UPRIGHT_HINGE = 1e-9
"""A hinge tilted by more than this (sine) leaves the plane."""
ROLE_NAMES = tuple(BAR_NAMES[bar] for bar in MOVING_BARS)
_SITES = ("B3", "B4")
GUESSED_ALIKE = 1e-9
"""Two guesses whose lengths fit equally well to this are distinguished by the drive."""
_MOST_BODIES = 8
"""Bodies on hinges among which three are looked for."""


def _find_named_body(model: mujoco.MjModel, name: str) -> int | None:
    """Find the body of a name, by what it is welded to; None where there is none."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    if number >= 0:
        return int(model.body_weldid[number])
    return None


def list_body_names(model: mujoco.MjModel) -> str:
    """List the bodies of a file by name, for a message."""
    names = []
    for number in range(1, model.nbody):
        names.append(model.body(number).name or f"(unnamed {number})")
    return ", ".join(names)


def _find_stated_body(
    model: mujoco.MjModel,
    names: Mapping[str, str],
    role: str,
) -> int:
    """Find the body of a bar by its given name, or by the bar's.

    Raises InputError if there is none.
    """
    name = names.get(role, role)
    body = _find_named_body(model, name)
    if body is None:
        raise InputError(
            "--name",
            f"{role}={name}",
            f"no such body; the file has: {list_body_names(model)}",
        )
    return body


class Topology:
    """Bars, pins, hinges and closure of a compiled model.

    Everything is measured in its rest state.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        names: Mapping[str, str],
        axes: Array | None = None,
    ) -> None:
        """Read a model.

        `axes`: x and y of its plane, (2, 3); None: those of the world that are in it.
        """
        self.model = model
        self.data = mujoco.MjData(model)
        self.names = dict(names)
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        self.root = {1: 0}
        for bar in MOVING_BARS:
            self.root[bar] = _find_stated_body(model, names, BAR_NAMES[bar])
        self.bar_of_root = {body: bar for bar, body in self.root.items()}
        if len(self.bar_of_root) < len(self.root):
            raise InputError(
                "--name",
                dict(names),
                "input, coupler and output must be three bodies that move",
            )
        self.point: dict[tuple[int, str], Array] = {}
        """(bar, pin): where the pin is in the frame of the bar's body, (3,), m."""
        self.hinge: dict[str, int] = {}
        self.sense: dict[str, float] = {}
        self._find_plane()
        if axes is not None:
            self.axes = axes
            self.normal = np.cross(*axes)
        for joint in range(model.njnt):
            self._add_hinge(joint)
        if len(self.hinge) != 3:
            raise InputError(
                "MJCF",
                sorted(self.hinge),
                "must have hinges at three of the pins O2, A, B, O4",
            )
        (self.cut,) = PINS.keys() - self.hinge.keys()
        self.closure: int | None = None
        self.closed_by = "nothing"
        self._find_closure(names)
        self._line = {}
        for bar in ENDS:
            x, y = self.line(self.data, bar)
            self._line[bar] = math.atan2(y, x)
        self._rest = self.data.qpos.copy()
        self._rest_angles = np.array(
            [
                self._line[2],
                self._line[3] - self._line[2],
                self._line[4],
            ]
        )
        self.to_joints = self._convert_to_joints()
        """Joint speeds from those of (theta_2, theta_3 - theta_2, theta_4), (3, 3)."""

    def drives(self) -> list[int]:
        """List the actuators that turn pin O2."""
        if "O2" in self.hinge:
            return self.list_actuators(self.hinge["O2"])
        return []

    def list_actuators(self, joint: int) -> list[int]:
        """List the actuators on a joint."""
        model = self.model
        on_joints = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
        on_this = model.actuator_trnid[:, 0] == joint
        actuators: list[int] = np.flatnonzero(on_joints & on_this).tolist()
        return actuators

    def stops(self, pin: str) -> tuple[float, float] | None:
        """Return the range of a pin, rad, or None without stops.

        Angles are from the line of the pin's bearer to its bar's.
        """
        model = self.model
        joint = self.hinge[pin]
        if not self._is_limited(joint):
            return None
        at_rest = model.qpos0[model.jnt_qposadr[joint]]
        turned = model.jnt_range[joint] - at_rest
        ends = self.rest_angle(pin) + self.sense[pin] * turned
        return float(ends.min()), float(ends.max())

    def _is_limited(self, joint: int) -> bool:
        """Tell whether stops end the range of a joint."""
        off = self.model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        return bool(self.model.jnt_limited[joint]) and not off

    def cylinders(self) -> list[int]:
        """List the actuators along a tendon that take a control.

        Without one a spring is such an actuator too.
        """
        model = self.model
        on_tendons = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
        controlled = model.actuator_gainprm.any(axis=1)
        actuators: list[int] = np.flatnonzero(on_tendons & controlled).tolist()
        return actuators

    def bar(self, body: int) -> int | None:
        """Return the bar that a body belongs to, None if it belongs to none."""
        return self.bar_of_root.get(int(self.model.body_weldid[body]))

    def _find_plane(self) -> None:
        hinges = self.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        if not hinges.any():
            raise InputError(
                "MJCF",
                None,
                "must have hinges at three of the pins O2, A, B, O4",
            )
        axis = self.data.xaxis[np.argmax(hinges)]
        nearest = int(np.argmax(np.abs(axis)))
        self.plane, axes = _PLANES[nearest]
        self.axes = np.eye(3)[list(axes)]
        tilt = np.abs(axis[list(axes)]).max()
        if tilt > UPRIGHT_HINGE:
            # as `fourbar mjcf --axis` turns it
            tilted = Plane(tuple(axis.tolist()))
            self.plane = "normal to " + " ".join(f"{part:.6g}" for part in axis)
            self.axes = tilted.rotation.T[:2]
        self.normal = np.cross(*self.axes)

    def _add_hinge(self, joint: int) -> None:
        model = self.model
        name = model.joint(joint).name or f"(unnamed {joint})"
        body = model.jnt_bodyid[joint]
        bars = [self.bar(body), self.bar(model.body_parentid[body])]
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        if kind != mujoco.mjtJoint.mjJNT_HINGE or None in bars:
            advice = self._advise(ROLE_NAMES, "name the bodies by --name")
            raise InputError(
                "MJCF",
                name,
                f"every joint must be a hinge of the input, coupler or output{advice}",
            )
        pin = _PIN_OF.get(frozenset(bars))  # type: ignore[arg-type]
        if pin is None or pin in self.hinge:
            raise InputError(
                "MJCF",
                name,
                "joins bars that have no pin in common, or have one already",
            )
        axis = self.data.xaxis[joint]
        tilt = float(np.linalg.norm(np.cross(axis, self.normal)))
        if tilt > UPRIGHT_HINGE:
            raise InputError(
                "MJCF",
                name,
                "the hinge is not parallel to the others; --loop NAME measures a loop "
                "whose axes differ a little",
            )
        self.hinge[pin] = joint
        self.sense[pin] = math.copysign(1.0, float(axis @ self.normal))
        for bar in bars:
            assert bar is not None
            self.point[bar, pin] = self._find_in_bar(bar, self.data.xanchor[joint])

    def _advise(self, roles: Sequence[str], advice: str) -> str:
        """Return advice on names; where all were stated, which they are."""
        if any(role not in self.names for role in roles):
            return f"; {advice}"
        stated = [f"{role}={self.names[role]}" for role in roles]
        if stated:
            return "; stated: " + ", ".join(stated)
        return ""

    def _find_in_bar(self, bar: int, world: Array) -> Array:
        body = self.root[bar]
        rotation = self.data.xmat[body].reshape(3, 3)
        return np.asarray(rotation.T @ (world - self.data.xpos[body]))

    def _find_closure(self, names: Mapping[str, str]) -> None:
        """Find the equality between the two bars of the cut pin.

        Two sites may mark it instead.
        """
        model = self.model
        kinds = mujoco.mjtEq
        for number in range(model.neq):
            kind = kinds(model.eq_type[number])
            closes = kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD)
            if not closes or not model.eq_active0[number]:
                continue
            ends = find_ends(model, self.data, number)
            bars = [self.bar(end.body) for end in ends]
            if None in bars or _PIN_OF.get(frozenset(bars)) != self.cut:  # type: ignore[arg-type]
                continue
            for bar, end in zip(bars, ends, strict=True):
                assert bar is not None
                self.point[bar, self.cut] = self._find_in_bar(bar, end.place)
            self.closure = number
            self.first = bars[0]
            by_sites = model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE
            word = "connect" if kind == kinds.mjEQ_CONNECT else "weld"
            ends_at = "sites" if by_sites else "body anchors"
            self.closed_by = f"{word} of {ends_at}"
            return
        self._find_sites(names)
        if (model.eq_type == kinds.mjEQ_TENDON).any():
            self.closed_by = "tendon"

    def _find_sites(self, names: Mapping[str, str]) -> None:
        """Find the two sites that mark pin B.

        Raises InputError if one is missing or on another body.
        """
        model = self.model
        for role, bar in zip(_SITES, PINS["B"], strict=True):
            name = names.get(role, role)
            site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
            if self.cut != "B" or site < 0 or self.bar(model.site_bodyid[site]) != bar:
                advice = self._advise(
                    _SITES if self.cut == "B" else (),
                    "where something else does, say where pin B is: "
                    "--name B3=SITE on the coupler, --name B4=SITE on the output",
                )
                raise InputError(
                    "MJCF",
                    self.cut,
                    f"no connect or weld closes the loop at this pin{advice}",
                )
            self.point[bar, "B"] = self._find_in_bar(bar, self.data.site_xpos[site])

    def in_plane(self, vector: Array) -> Array:
        """Project on the linkage's plane, (2,)."""
        return np.asarray(self.axes @ vector)

    def world(
        self,
        data: mujoco.MjData,
        bar: int,
        pin: str,
    ) -> Array:
        """Locate a bar's pin, world axes, (3,)."""
        body = self.root[bar]
        rotation = data.xmat[body].reshape(3, 3)
        return np.asarray(data.xpos[body] + rotation @ self.point[bar, pin])

    def line(self, data: mujoco.MjData, bar: int) -> Array:
        """Return a bar's line in the plane, first pin to second, (2,), m."""
        first, second = (self.world(data, bar, pin) for pin in ENDS[bar])
        return self.in_plane(second - first)

    def length(self, bar: int) -> float:
        """Measure the distance between a bar's pins in the plane, m."""
        return math.hypot(*self.line(self.data, bar))

    @property
    def ground_angle(self) -> float:
        """Return theta_1, rad."""
        return self._line[1]

    @property
    def rest_angles(self) -> tuple[float, float, float]:
        """Return theta_1, theta_2 and theta_4 of the rest state, rad."""
        return self._line[1], self._line[2], self._line[4]

    def turned(self, ground_angle: float, *, behind: bool = False) -> "Topology":
        """Return the same four-bar in axes in which theta_1 is this angle, rad.

        `behind`: seen from the other side.
        """
        x, y = self.axes
        seen_angle = self.ground_angle
        if behind:
            y = -y
            seen_angle = -seen_angle
        angle = seen_angle - ground_angle
        cos = math.cos(angle)
        sin = math.sin(angle)
        axes = np.array([cos * x + sin * y, cos * y - sin * x])
        return Topology(self.model, self.names, axes)

    def copied(self) -> "Topology":
        """Return the same four-bar in a model of its own, which may be changed."""
        return Topology(copy(self.model), self.names, self.axes)

    def rest_angle(self, pin: str) -> float:
        """Return the angle of a hinge in the rest state, rad.

        Angles are from the line of the pin's bearer to that of the bar that hangs on
        it.
        """
        child, parent = self.turning(pin)
        return self._line[child] - self._line[parent]

    def along_bar(self, bar: int, world: Array) -> tuple[float, float]:
        """Return (along, to the left) of a point from a bar's first pin at rest, m."""
        first_pin = self.world(self.data, bar, ENDS[bar][0])
        return self.turned_back(bar, world - first_pin)

    def turned_back(self, bar: int, vector: Array) -> tuple[float, float]:
        """Resolve a vector along a bar's line in the rest state and to its left."""
        x, y = self.in_plane(vector)
        cos = math.cos(self._line[bar])
        sin = math.sin(self._line[bar])
        return float(cos * x + sin * y), float(cos * y - sin * x)

    def _convert_to_joints(self) -> Array:
        turns = {
            1: np.zeros(3),
            2: np.array([1.0, 0, 0]),
            3: np.array([1.0, 1.0, 0]),
            4: np.array([0, 0, 1.0]),
        }
        matrix = np.zeros((self.model.nv, 3))
        for pin, joint in self.hinge.items():
            child, parent = self.turning(pin)
            dof = self.model.jnt_dofadr[joint]
            matrix[dof] = self.sense[pin] * (turns[child] - turns[parent])
        return matrix

    def turning(self, pin: str) -> tuple[int, int]:
        """Return the bar that hangs on the hinge of a pin, and its bearer."""
        body = self.model.jnt_bodyid[self.hinge[pin]]
        child = self.bar(body)
        assert child is not None
        (parent,) = set(PINS[pin]) - {child}
        return child, parent

    def qpos(self, x: Sequence[float]) -> Array:
        """Return the joint positions at (theta_2, theta_3 - theta_2, theta_4).

        MuJoCo counts the turns of a hinge: a joint with stops stands in the turn of its
        range.
        """
        q = self._rest.copy()
        turned = self.to_joints @ (np.asarray(x) - self._rest_angles)
        for joint in self.hinge.values():
            address = self.model.jnt_qposadr[joint]
            q[address] += turned[self.model.jnt_dofadr[joint]]
            if self._is_limited(joint):
                middle = float(self.model.jnt_range[joint].mean())
                q[address] = middle + math.remainder(q[address] - middle, math.tau)
        return np.asarray(q)

    def angles(self, data: mujoco.MjData) -> Array:
        """Return (theta_2, theta_3 - theta_2, theta_4) of a state."""
        moved = np.empty(3)
        for joint in self.hinge.values():
            dof = self.model.jnt_dofadr[joint]
            address = self.model.jnt_qposadr[joint]
            moved[dof] = data.qpos[address] - self._rest[address]
        turned = np.linalg.solve(self.to_joints, moved)
        return np.asarray(turned + self._rest_angles)


def find_topology(
    model: mujoco.MjModel,
    names: Mapping[str, str],
    lengths: Sequence[float],
) -> tuple[Topology, list[str]]:
    """Find the four-bar in a model; add a note on what was guessed.

    Names that are given, or in the file, stand.

    `lengths`: of ground, input, coupler and output in the scene, m: the guess that fits
    them best is taken.

    Raises InputError in one line: why no three bodies fit.
    """
    roles = {role: names.get(role, role) for role in (*ROLE_NAMES, *_SITES)}
    bodies: dict[str, int | None] = {}
    for role in ROLE_NAMES:
        if role in names:
            bodies[role] = _find_stated_body(model, names, role)
        else:
            bodies[role] = _find_named_body(model, role)
    missing = [role for role, body in bodies.items() if body is None]
    if not missing and _is_pin_b_known(model, roles, names):
        return Topology(model, names), []
    on_hinges = {int(model.body_weldid[body]) for body in model.jnt_bodyid}
    free = sorted(on_hinges - set(bodies.values()))
    guesses: list[_Guess] = []
    refused: list[str] = []
    for chosen in permutations(free[:_MOST_BODIES], len(missing)):
        chosen_names = [model.body(body).name for body in chosen]
        guessed = dict(zip(missing, chosen_names, strict=True))
        if not all(guessed.values()):
            refused.append("a body without a name, which --name cannot state either")
            continue
        for sites in _list_sites(model, {**roles, **guessed}, names):
            try:
                topology = Topology(model, {**names, **guessed, **sites})
                misfit = _measure_misfit(topology, lengths)
                guesses.append(_Guess(misfit, topology, {**guessed, **sites}))
            except InputError as error:
                refused.append(error.allowed)
    if not guesses:
        if refused:
            why = refused[0]
        elif len(free) < len(missing):
            why = "it has fewer bodies on hinges"
        else:
            why = "no connect, weld or pair of sites closes it"
        _refuse_guesses(model, names, missing, why)
    best = min(guess.misfit for guess in guesses)
    alike = [guess for guess in guesses if guess.misfit <= best + GUESSED_ALIKE]
    guess = min(alike, key=lambda guess: not guess.topology.drives())
    pairs = ", ".join(f"{role}={name}" for role, name in guess.names.items())
    note = (
        f"guessed from what hangs together and from the lengths: {pairs} (--name states"
        " it otherwise)"
    )
    return guess.topology, [note]


class _Guess(NamedTuple):
    """A four-bar that a model may be meant to hold."""

    misfit: float
    topology: Topology
    names: dict[str, str]
    """Bodies and sites by the roles that were guessed for them."""


def _is_pin_b_known(
    model: mujoco.MjModel,
    roles: Mapping[str, str],
    names: Mapping[str, str],
) -> bool:
    """Tell whether an equality, a stated name or the usual name says where pin B is."""
    stated = bool(names.keys() & {*_SITES})
    return stated or _find_site(model, roles["B3"]) or not _open_sites(model)


def _refuse_guesses(
    model: mujoco.MjModel,
    names: Mapping[str, str],
    missing: list[str],
    why: str,
) -> NoReturn:
    """Raise InputError: no guess makes a four-bar of a model."""
    unnamed = ", ".join(missing) or "B3, B4"
    text = f"no body is named {unnamed}, and no guess makes a four-bar ({why})"
    unstated = [role for role in missing or _SITES if role not in names]
    if unstated:
        kind = "BODY" if missing else "SITE"
        text += f"; say which is which: --name {unstated[0]}={kind}, and so on"
    raise InputError("MJCF", list_body_names(model), text)


def _find_site(model: mujoco.MjModel, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name) >= 0)


def _open_sites(model: mujoco.MjModel) -> bool:
    """Tell whether only sites can say where the loop closes."""
    kinds = mujoco.mjtEq
    closing = (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD)
    return not any(kinds(kind) in closing for kind in model.eq_type)


def _list_sites(
    model: mujoco.MjModel,
    roles: Mapping[str, str],
    names: Mapping[str, str],
) -> list[dict[str, str]]:
    """List pairs of sites that may mark pin B.

    None need be given if a connect or a weld closes the loop.
    """
    if _is_pin_b_known(model, roles, names):
        return [{}]
    on_coupler = _list_named_sites(model, roles["coupler"])
    on_output = _list_named_sites(model, roles["output"])
    pairs = []
    for three in on_coupler:
        for four in on_output:
            pairs.append({"B3": three, "B4": four})
    return pairs


def _list_named_sites(model: mujoco.MjModel, name: str) -> list[str]:
    """List the sites with a name on the body of a name."""
    wanted = _find_named_body(model, name)
    names = []
    for number in range(model.nsite):
        site = model.site(number).name
        body = int(model.body_weldid[model.site_bodyid[number]])
        if site and body == wanted:
            names.append(site)
    return names


def _measure_misfit(topology: Topology, lengths: Sequence[float]) -> float:
    """Measure how far its lengths are from the scene's: the sum of |log ratio|."""
    theirs = [topology.length(bar) for bar in BAR_NAMES]
    if min(theirs) <= 0.0:
        return math.inf
    misfit = 0.0
    for their_length, length in zip(theirs, lengths, strict=True):
        misfit += abs(math.log(their_length / length))
    return misfit

"""An SDF world or model as MJCF.

Links become bodies and joints become hinges, slides and balls. A joint that closes a
loop, and Drake's constraints, become a connect or a weld. The text keeps every digit
of the file; MuJoCo's own writer keeps six.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import permutations
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from fourbar.errors import InputError
from fourbar.linkage import record
from fourbar.quantities import Array

DEFAULT_GRAVITY = "0 0 -9.8"
DEFAULT_DENSITY = "1000"
"""kg/m^3, of a collision that states none."""
DEFAULT_TIMESTEP = "0.001"
"""s."""
UNBOUNDED = 1e16
"""rad or m; a limit beyond it is none."""
_WIDEST = 1e9
"""rad or m; stands for a missing end of a range of which the other is stated."""
LEAST_INERTIA = 1e-13
"""kg m^2; a thin rod states 0 about itself, which MuJoCo takes from no moving body."""
_BUSHING = "drake_linear_bushing_rpy"
_PIN = "drake_ball_constraint"
_WELD = "drake_weld_constraint"
_FRAMES = ("drake_parent_frame", "drake_child_frame")
"""Elements of a joint that name its frame on each link; they coincide at its zero."""
_ENDS = {
    _WELD: {"parent": "", "child": ""},
    _PIN: {f"{_PIN}_body_A": f"{_PIN}_p_AP", f"{_PIN}_body_B": f"{_PIN}_p_BQ"},
}
"""Elements of a constraint that name its bodies, each with that of a point on it."""
_AXES = {
    "fixed": (),
    "ball": (),
    **dict.fromkeys(("revolute", "continuous", "prismatic"), ("axis",)),
    **dict.fromkeys(("universal", "revolute2"), ("axis", "axis2")),
}
"""Elements that state the axes of each type of joint that is read."""
_MEMBERS = ("link", "joint", "frame", "model", "include")
_NAMED_NOWHERE = {
    *_MEMBERS,
    "world",
    "pose",
    "inertial",
    "collision",
    "gravity",
    "static",
    "physics",
    "parent",
    "child",
    "axis",
    "axis2",
    "uri",
    "name",
    "placement_frame",
    _PIN,
    _WELD,
    *_FRAMES,
    "visual",
    "light",
    "scene",
    "gui",
    "audio",
    "atmosphere",
    "magnetic_field",
    "spherical_coordinates",
    "self_collide",
    "allow_auto_disable",
}
"""Elements that are read, or that no force of a loop depends on."""

FindModel = Callable[[str], ET.Element]
"""Function from the URI of an <include> to the <sdf> of that file."""


class MissingModelError(InputError):
    """The file that an <include> names is not there."""


def convert_sdf(root: ET.Element, find: FindModel) -> tuple[ET.Element, list[str]]:
    """Return an <sdf> as <mujoco>, and sentences on what it cannot carry.

    Parameters
    ----------
    find : reads the file that an <include> names. A `MissingModelError` leaves it out,
        unless a link of it is named elsewhere or nothing that is left closes a loop.

    Raises
    ------
    InputError : what is missing or contradicts itself, in one line.
    """
    _name_prefixes(root)
    try:
        return _Conversion(find).convert(root)
    except RecursionError:
        refused = "is placed relative to itself or attached to itself"
        raise _refuse("one of its frames", refused) from None


def _name_prefixes(root: ET.Element) -> None:
    """Write the tags of Drake's elements so that a path may hold them, "drake_..."."""
    for element in root.iter():
        element.tag = re.sub("{[^}]*drake[^}]*}", "drake_", element.tag)


def _refuse(what: object, allowed: str) -> InputError:
    return InputError("SDF", what, allowed)


def _text(element: ET.Element, path: str, default: str = "") -> str:
    """Return the text of a descendant, or a default where it is missing or empty."""
    return (element.findtext(path) or "").strip() or default


def _numbers(text: str, count: int, what: str) -> list[float]:
    """Read so many finite numbers."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise _refuse(text.strip(), f"must be {count} finite numbers: {what}")
    return numbers


def _number(element: ET.Element, path: str, default: str, name: str) -> float:
    """Read one finite number below an element of a named link or joint."""
    return _numbers(_text(element, path, default), 1, f"{path} of {name}")[0]


def _is_true(text: str) -> bool:
    return text.strip().lower() in ("true", "1")


def _join(scope: str, name: str) -> str:
    """Return the full name of what a model calls by a name; "" is the world."""
    if name in ("", "__model__"):
        return scope
    if name == "world":
        return ""
    return f"{scope}::{name}" if scope else name


def _shorten(name: str) -> str:
    """Return a full name without the models that hold it."""
    return name.rpartition("::")[2]


def _attribute(element: ET.Element, path: str, name: str) -> str:
    """Return an attribute of a descendant, "" where either is missing."""
    found = element.find(path)
    return "" if found is None else found.get(name, "")


def _make_pose_matrix(element: ET.Element) -> Array:
    """Return the matrix of the <pose> of an element, (4, 4)."""
    matrix = np.eye(4)
    text = _text(element, "pose")
    if not text:
        return matrix
    what = f"the pose of {element.get('name', element.tag)}"
    if _attribute(element, "pose", "rotation_format") == "quat_xyzw":
        numbers = _numbers(text, 7, what)
        rotation = Rotation.from_quat(numbers[3:])
    else:
        numbers = _numbers(text, 6, what)
        degrees = _is_true(_attribute(element, "pose", "degrees"))
        rotation = Rotation.from_euler("xyz", numbers[3:], degrees=degrees)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = numbers[:3]
    return matrix


@record
class _Member:
    """A model, link, joint or frame; names are full ones."""

    element: ET.Element
    scope: str
    """Model that holds it."""
    static: bool
    carrier: str
    """What a joint or frame is attached to; that of a model is not known yet."""

    @property
    def reference(self) -> str:
        """Name of what the pose is stated in."""
        stated = _attribute(self.element, "pose", "relative_to")
        if stated or self.element.tag not in ("joint", "frame"):
            return _join(self.scope, stated)
        return self.carrier


@dataclass(frozen=True, slots=True, eq=False)
class _Edge:
    """Joint between two links, or what fixes a link to the world."""

    name: str
    kind: str
    parent: str
    child: str
    scope: str
    element: ET.Element

    def rank(self) -> int:
        """Return how early the joint belongs to the tree: the last may close a loop.

        A ball is a connect without loss, and so is a hinge of a planar loop on which
        nothing acts; a fixed joint is a weld without loss. A range is the least loss.
        A joint of another kind cannot close a loop.
        """
        if self.kind == "ball":
            return 5
        if self.kind == "fixed":
            return 2 if self.name else 0
        if self.kind not in ("revolute", "continuous"):
            return 0
        return {(): 4, ("range",): 3}.get(tuple(self.list_losses()), 1)

    def list_losses(self) -> list[str]:
        """List what is lost where the joint closes a loop."""
        axis = self.element.find("axis")
        if axis is None:
            return []
        losses = [
            word for word in _read_dynamics(axis, self.name) if word != "springref"
        ]
        return losses + ["mimic"] * (axis.find("mimic") is not None)

    def read_start(self) -> float:
        """Return <initial_position> of a joint with one axis, rad or m; 0 without."""
        if len(_AXES[self.kind]) != 1:
            return 0.0
        return _number(self.element, "axis/initial_position", "0", self.name)


class _Conversion:
    """One SDF file that is being converted; links and frames have full names."""

    def __init__(self, find: FindModel) -> None:
        self.find = find
        self.members: dict[str, _Member] = {}
        self.edges: list[_Edge] = []
        self.constraints: list[tuple[str, ET.Element]] = []
        self.notes: list[str] = []
        self.left_out: set[str] = set()
        self.missing: dict[str, MissingModelError] = {}
        """By the URI of an <include>."""
        self.tree: dict[str, tuple[_Edge | None, str]] = {}
        """Joint by which each link hangs on another, and that link."""
        self.names: dict[str, str] = {"": "world"}

    def convert(self, root: ET.Element) -> tuple[ET.Element, list[str]]:
        """Convert the file."""
        worlds = [one for one in root if one.tag in ("world", "model")]
        if not worlds:
            raise _refuse(root.tag, "holds neither a <world> nor a <model>")
        world = worlds[0]
        if world.tag == "model":
            world = ET.Element("world")
            world.extend(worlds)
        self._collect("", world, static=False)
        for name, member in self.members.items():
            self._read_member(name, member)
        links, joints = (
            [name for name, one in self.members.items() if one.element.tag == tag]
            for tag in ("link", "joint")
        )
        for members in (links, joints):
            # as the file does, with models where names repeat
            counts = Counter(map(_shorten, members))
            for name in members:
                short = _shorten(name)
                self.names[name] = short if counts[short] == 1 else name
        self._grow_tree(links)
        mujoco = ET.Element("mujoco")
        ET.SubElement(mujoco, "compiler", angle="radian")
        if world.find("gravity") is None:
            self.notes.append(
                "no <world> states gravity: SDFormat's own, 9.8 m/s^2, is taken"
            )
        gravity = _numbers(_text(world, "gravity", DEFAULT_GRAVITY), 3, "gravity")
        timestep = _text(world, "physics/max_step_size", DEFAULT_TIMESTEP)
        ET.SubElement(mujoco, "option", gravity=_write(gravity), timestep=timestep)
        self.asset = ET.SubElement(mujoco, "asset")
        self.body = {"": ET.SubElement(mujoco, "worldbody")}
        for link in self.tree:
            self._add_body(link)
        self.equality = ET.SubElement(mujoco, "equality")
        self._add_closures()
        if self.missing:
            if not len(self.equality):
                raise next(iter(self.missing.values()))
            self.notes.append(
                f"models that are missing are left out: {', '.join(self.missing)}"
            )
        if self.left_out:
            names = ", ".join(sorted(self.left_out)).replace("drake_", "drake:")
            self.notes.append(f"left out of the SDF: {names}")
        if _BUSHING in self.left_out:
            self.notes.append(
                "a bushing joins two links by springs; if it closes the loop, put "
                "<drake:ball_constraint> in its place, a rigid pin"
            )
        return mujoco, self.notes

    def _collect(self, scope: str, holder: ET.Element, *, static: bool) -> None:
        """Read the names of a world or model, and then those of the models inside."""
        models = []
        for child in holder:
            if child.tag in (_PIN, _WELD):
                self.constraints.append((scope, child))
            elif child.tag not in _NAMED_NOWHERE:
                self.left_out.add(child.tag)
            if child.tag not in _MEMBERS:
                continue
            try:
                element = self._include(child) if child.tag == "include" else child
            except MissingModelError as error:
                self.missing[_text(child, "uri")] = error
                continue
            name = element.get("name", "")
            full = _join(scope, name)
            if not name or full in self.members:
                raise _refuse(name, f"must be a name of its own, in {scope or 'world'}")
            attached = element.get("attached_to", "")
            if element.tag == "joint":
                attached = _text(element, "child")
            fixed = static or _is_true(_text(element, "static"))
            carrier = _join(scope, attached)
            self.members[full] = _Member(element, scope, fixed, carrier)
            if element.tag == "model":
                models.append(full)
        for name in models:
            model = self.members[name]
            self._collect(name, model.element, static=model.static)

    def _include(self, include: ET.Element) -> ET.Element:
        """Return the model of an included file, with what the include states anew."""
        uri = _text(include, "uri")
        if _is_true(include.get("merge", "")):
            raise _refuse(uri, 'is included with merge="true", which is not read')
        included = self.find(uri)
        _name_prefixes(included)
        model = included.find("model")
        if model is None:
            raise _refuse(uri, "holds no <model>")
        model = deepcopy(model)
        for name in ("pose", "static"):
            stated = include.find(name)
            if stated is not None:
                for old in model.findall(name):
                    model.remove(old)
                model.append(stated)
        model.set("name", _text(include, "name", model.get("name", "")))
        placement = _text(include, "placement_frame")
        if placement:
            model.set("placement_frame", placement)
        return model

    def _read_member(self, name: str, member: _Member) -> None:
        """Read a link or a joint, now that all names are known."""
        element = member.element
        if element.tag == "model":
            return
        self.left_out |= {child.tag for child in element} - _NAMED_NOWHERE
        if element.tag == "link" and member.static:
            self.edges.append(_Edge("", "fixed", "", name, "", element))
        if element.tag != "joint" or member.static:
            return
        kind = element.get("type", "")
        if kind not in _AXES:
            self.left_out.add(f"the {kind} joint {element.get('name')}")
            return
        parent, child = (
            self._find_link(_join(member.scope, _text(element, end)))
            for end in ("parent", "child")
        )
        if parent != child:
            self.edges.append(_Edge(name, kind, parent, child, member.scope, element))

    def _find_member(self, name: str) -> _Member:
        """Return a member by its full name."""
        if name not in self.members:
            scope, _, short = name.rpartition("::")
            unknown = _refuse(short, f"is no link, joint, frame or model of {scope}")
            raise next(iter(self.missing.values()), unknown)
        return self.members[name]

    def _locate(self, name: str, base: str = "") -> Array:
        """Return the pose of a member in the frame of a model or the world, (4, 4)."""
        if name == base:
            return np.eye(4)
        member = self._find_member(name)
        element = member.element
        pose = self._locate(member.reference, base) @ _make_pose_matrix(element)
        placed = element.get("placement_frame", "")
        if placed:
            pose = pose @ np.linalg.inv(self._locate(_join(name, placed), name))
        return pose

    def _find_link(self, name: str) -> str:
        """Return the link that a name stands for or is attached to."""
        if not name:
            return ""
        member = self._find_member(name)
        if member.element.tag == "model":
            inside = [
                other.element.get("name", "")
                for other in self.members.values()
                if other.scope == name and other.element.tag in ("link", "model")
            ]
            stated = member.element.get("canonical_link")
            if not (stated or inside):
                raise _refuse(name, "has no link")
            return self._find_link(_join(name, stated or inside[0]))
        return name if member.element.tag == "link" else self._find_link(member.carrier)

    def _locate_in(self, link: str, name: str) -> Array:
        """Return the pose of a member in a link, (4, 4)."""
        return np.linalg.inv(self._locate(link)) @ self._locate(name)

    def _find_frame(self, edge: _Edge, link: str) -> str:
        """Return the frame of a joint on one of its links."""
        stated = _text(edge.element, _FRAMES[link == edge.child])
        return _join(edge.scope, stated) if stated else edge.name

    def _place(self, edge: _Edge, link: str) -> Array:
        """Return the pose of a joint in one of its links, (4, 4)."""
        return self._locate_in(link, self._find_frame(edge, link))

    def _grow_tree(self, links: list[str]) -> None:
        """Hang each link on another by a joint, from the world outwards.

        Of the joints that reach a further link the first is that of the lowest rank, of
        equals the nearest to the world.
        """
        ranks = {edge: edge.rank() for edge in self.edges}
        depths = {"": 0}
        for root in ("", *links):
            if root not in depths:
                depths[root] = 0
                self.tree[root] = (None, "")
            while leading := [
                (ranks[edge], depths[bearer], number, link, bearer)
                for number, edge in enumerate(self.edges)
                for link, bearer in permutations((edge.child, edge.parent))
                if bearer in depths and link not in depths
            ]:
                _, depth, number, link, bearer = min(leading)
                self.tree[link] = (self.edges[number], bearer)
                depths[link] = depth + 1
        hanging = [edge for edge, _ in self.tree.values()]
        self.closing = [
            edge for edge in self.edges if edge.name and edge not in hanging
        ]

    def _add_body(self, link: str) -> None:
        """Add a link as a body of the one that it hangs on."""
        edge, bearer = self.tree[link]
        body = ET.SubElement(self.body[bearer], "body")
        self.body[link] = body
        if edge is None:
            pose = self._locate(link)
            ET.SubElement(body, "freejoint", name=f"free joint of {self.names[link]}")
        else:
            pose = self._place(edge, bearer) @ np.linalg.inv(self._place(edge, link))
            for joint, motion in self._list_joints(edge, link) if edge.name else ():
                pose = pose @ motion
                ET.SubElement(body, "joint", joint)
        body.attrib |= {"name": self.names[link], **_write_place(pose)}
        element = self.members[link].element
        if _text(element, "gravity") in ("false", "0"):
            body.set("gravcomp", "1")
        if not self._is_fixed(link):
            self._add_inertia(body, link, element)

    def _is_fixed(self, link: str) -> bool:
        """Tell whether a link is fixed to the world."""
        edge, bearer = self.tree[link]
        fixed = edge is not None and edge.kind == "fixed"
        return fixed and (not bearer or self._is_fixed(bearer))

    def _list_joints(
        self, edge: _Edge, link: str
    ) -> Iterator[tuple[dict[str, str], Array]]:
        """List the joints of MJCF of one joint of SDF, on the link that it carries.

        Each comes with the motion of the link by its `ref`, (4, 4).
        """
        name = self.names[edge.name]
        place = self._place(edge, link)
        pin = place[:3, 3]
        if edge.kind == "ball":
            yield {"name": name, "type": "ball", "pos": _write(pin)}, np.eye(4)
        start = edge.read_start()
        forwards = edge.child == link
        own = self._find_frame(edge, edge.child)
        axes = _AXES[edge.kind]
        for tag in axes if forwards else reversed(axes):
            axis = edge.element.find(tag)
            if axis is None:
                axis = ET.Element(tag)
            stated = _attribute(axis, "xyz", "expressed_in")
            frame = _join(edge.scope, stated) if stated else own
            if not stated and _is_true(_text(axis, "use_parent_model_frame")):
                frame = edge.scope
            direction = _numbers(_text(axis, "xyz", "0 0 1"), 3, f"axis of {name}")
            turned = (place @ self._locate_in(own, frame))[:3, :3] @ direction
            if not forwards:
                turned = -turned
            joint = {
                "name": name if tag == "axis" else f"{name}::{tag}",
                "type": "slide" if edge.kind == "prismatic" else "hinge",
                "pos": _write(pin),
                "axis": _write(turned),
            }
            motion = np.eye(4)
            if start:
                joint["ref"] = repr(start)
                shift = start * (turned / np.linalg.norm(turned))
                if edge.kind == "prismatic":
                    motion[:3, 3] = shift
                else:
                    motion[:3, :3] = Rotation.from_rotvec(shift).as_matrix()
                    motion[:3, 3] = pin - motion[:3, :3] @ pin
            yield joint | _read_dynamics(axis, name), motion

    def _add_inertia(self, body: ET.Element, link: str, element: ET.Element) -> None:
        """Add mass and inertia, as stated or of collisions; SDF's own are of size 1."""
        name = self.names[link]
        inertial = element.find("inertial")
        if inertial is None:
            inertial = ET.Element("inertial")
        if _is_true(inertial.get("auto", "")):
            if inertial.find("mass") is not None:
                raise _refuse(name, 'states a <mass> beside auto="true": not read')
            self._add_collisions(body, link, element, _text(inertial, "density"))
            return
        tensor = [
            [
                _number(inertial, f"inertia/i{min(a, b)}{max(a, b)}", own, name)
                for a, own in zip("xyz", row, strict=True)
            ]
            for b, row in zip("xyz", np.eye(3).astype(str), strict=True)
        ]
        moments, axes = np.linalg.eigh(tensor)
        pose = _make_pose_matrix(inertial)
        pose[:3, :3] = pose[:3, :3] @ axes * np.linalg.det(axes)
        mass = _number(inertial, "mass", "1", name)
        if mass <= 0.0:
            raise _refuse(mass, f"must be above 0: the mass of {name}, kg")
        stated = {"mass": repr(mass), **_write_place(pose)}
        stated["diaginertia"] = _write(np.maximum(moments, LEAST_INERTIA))
        ET.SubElement(body, "inertial", stated)

    def _add_collisions(
        self, body: ET.Element, link: str, element: ET.Element, density: str
    ) -> None:
        """Add a link's collisions as geoms, from which MuJoCo computes its inertia."""
        scope = self.members[link].scope
        for collision in element.findall("collision"):
            shape = collision.find("geometry/*")
            if shape is None or shape.tag == "plane":
                continue
            stated = _attribute(collision, "pose", "relative_to")
            reference = _join(scope, stated) if stated else link
            pose = self._locate_in(link, reference) @ _make_pose_matrix(collision)
            own = _text(collision, "density", density or DEFAULT_DENSITY)
            place = {**_write_place(pose), "density": own}
            ET.SubElement(body, "geom", {**self._read_shape(shape), **place})
        if body.find("geom") is None:
            reason = 'has no collision that its inertial auto="true" could be that of'
            raise _refuse(self.names[link], reason)

    def _read_shape(self, shape: ET.Element) -> dict[str, str]:
        """Return type and size of a geom."""
        if shape.tag == "mesh":
            name = f"mesh {len(self.asset)}"
            scale = _write(_numbers(_text(shape, "scale", "1 1 1"), 3, "scale"))
            file = _text(shape, "uri").rpartition("://")[2]
            ET.SubElement(self.asset, "mesh", name=name, file=file, scale=scale)
            return {"type": "mesh", "mesh": name}
        if shape.tag not in _SIZES:
            raise _refuse(
                shape.tag, f"has no inertia here; read are {', '.join(_SIZES)}"
            )
        sizes = [
            factor * number
            for name, count, factor in _SIZES[shape.tag]
            for number in _numbers(_text(shape, name), count, f"{name} of {shape.tag}")
        ]
        return {"type": shape.tag, "size": _write(sizes)}

    def _add_closures(self) -> None:
        """Add what closes loops, and the joints that follow others."""
        for edge in self.closing:
            name = self.names[edge.name]
            ends = {end: self._place(edge, end) for end in (edge.parent, edge.child)}
            if edge.kind == "fixed":
                self._close("weld", name, ends)
            elif edge.kind not in ("revolute", "continuous", "ball"):
                self.left_out.add(f"the {edge.kind} joint {name} of a loop")
            else:
                self._close("connect", name, ends)
                text = (
                    f"{name} closes a loop: it is a <connect>, which holds its point "
                    "and not its axis"
                )
                if losses := edge.list_losses():
                    text += f"; lost: {', '.join(losses)}"
                self.notes.append(text)
        for scope, constraint in self.constraints:
            self._add_constraint(scope, constraint)
        for edge in self.edges:
            if edge not in self.closing:
                self._add_mimic(edge)

    def _add_constraint(self, scope: str, constraint: ET.Element) -> None:
        """Add a constraint of Drake: a weld of two frames, or a pin of two points."""
        ends = {}
        for body, point in _ENDS[constraint.tag].items():
            frame = _join(scope, _text(constraint, body))
            link = self._find_link(frame)
            place = self._locate_in(link, frame)
            if point:
                where = _numbers(_text(constraint, point), 3, point)
                place[:3, 3] += place[:3, :3] @ where
            ends[link] = place
        if len(ends) != 2:
            tag = constraint.tag.replace("drake_", "drake:")
            raise _refuse(tag, "must join two bodies")
        kind = "weld" if constraint.tag == _WELD else "connect"
        self._close(kind, "", ends)  # two may join the same two links

    def _close(self, kind: str, name: str, ends: dict[str, Array]) -> None:
        """Close a loop between places of two links, (4, 4) each."""
        closure = ET.SubElement(self.equality, kind, name=name)
        for number, (link, place) in enumerate(ends.items(), 1):
            name_of_site = f"closure {len(self.equality)} {number}"
            site = {"name": name_of_site, **_write_place(place)}
            ET.SubElement(self.body[link], "site", site)
            closure.set(f"site{number}", site["name"])

    def _add_mimic(self, edge: _Edge) -> None:
        """Add the line by which a joint follows another."""
        for mimic in edge.element.findall("axis/mimic"):
            leader = _join(edge.scope, mimic.get("joint", ""))
            multiplier = _number(mimic, "multiplier", "1", edge.name)
            offset = _number(mimic, "offset", "0", edge.name)
            reference = _number(mimic, "reference", "0", edge.name)
            # MuJoCo's polynomial counts both joints from where they start
            start = sum(
                other.read_start() for other in self.edges if other.name == leader
            )
            constant = offset + multiplier * (start - reference) - edge.read_start()
            ET.SubElement(
                self.equality,
                "joint",
                joint1=self.names[edge.name],
                joint2=self.names.get(leader, leader),
                polycoef=_write([constant, multiplier, 0.0, 0.0, 0.0]),
            )


_SIZES = {
    "box": (("size", 3, 0.5),),
    "sphere": (("radius", 1, 1.0),),
    "cylinder": (("radius", 1, 1.0), ("length", 1, 0.5)),
    "capsule": (("radius", 1, 1.0), ("length", 1, 0.5)),
    "ellipsoid": (("radii", 3, 1.0),),
}
"""Elements that state the size of each shape: name, numbers, and MuJoCo's part."""


def _read_dynamics(axis: ET.Element, name: str) -> dict[str, str]:
    """Return range, damping, friction and spring of an axis as attributes of MJCF."""
    attributes = {}
    for tag, attribute in (
        ("damping", "damping"),
        ("friction", "frictionloss"),
        ("spring_stiffness", "stiffness"),
        ("spring_reference", "springref"),
    ):
        number = _number(axis, f"dynamics/{tag}", "0", name)
        if number:
            attributes[attribute] = repr(number)
    limits = []
    for end, widest in (("lower", -_WIDEST), ("upper", _WIDEST)):
        text = _text(axis, f"limit/{end}", "inf")
        limit = UNBOUNDED
        if text.lstrip("+-") != "inf":
            (limit,) = _numbers(text, 1, f"limit of {name}")
        limits.append(widest if abs(limit) >= UNBOUNDED else limit)
    if limits != [-_WIDEST, _WIDEST]:
        attributes["range"] = _write(limits)
    return attributes


def _write_place(pose: Array) -> dict[str, str]:
    """Return place and orientation as attributes of MJCF."""
    turned = Rotation.from_matrix(pose[:3, :3])
    quaternion = turned.as_quat(scalar_first=True)
    return {"pos": _write(pose[:3, 3]), "quat": _write(quaternion)}


def _write(numbers: Array | list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)

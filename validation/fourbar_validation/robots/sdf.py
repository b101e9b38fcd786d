"""An SDF world or model as MJCF.

Links become bodies and joints become hinges, slides and balls. A joint that closes a
loop, and Drake's ball constraint, become a connect. The text keeps every digit of the
file; MuJoCo's own writer keeps six.
"""

import heapq
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from fourbar.errors import InputError
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
_DRAKE = "{http://drake.mit.edu}"
_BUSHING = "drake:linear_bushing_rpy"
_DEGREES_OF_FREEDOM = {
    "fixed": (),
    "revolute": ("axis",),
    "continuous": ("axis",),
    "prismatic": ("axis",),
    "universal": ("axis", "axis2"),
    "revolute2": ("axis", "axis2"),
    "ball": (),
}
"""Elements that state the axes of each type of joint that is read."""
_ELEMENTS_READ = {
    *("world", "model", "link", "joint", "frame", "include", "pose", "inertial"),
    *("collision", "gravity", "static", "physics", "parent", "child", "axis", "axis2"),
    *("uri", "name", "placement_frame", "drake:ball_constraint"),
}
_OF_NO_FORCE = {
    *("visual", "light", "scene", "gui", "audio", "atmosphere", "magnetic_field"),
    *("spherical_coordinates", "self_collide", "allow_auto_disable"),
}
"""Elements that no force of a loop depends on."""

FindModel = Callable[[str], ET.Element]
"""Function from the URI of an <include> to the <sdf> of that file."""


def convert_sdf(root: ET.Element, find: FindModel) -> tuple[ET.Element, list[str]]:
    """Return an <sdf> as <mujoco>, and sentences on what it cannot carry.

    Parameters
    ----------
    find : reads the file that an <include> names.

    Raises
    ------
    InputError : what is missing or contradicts itself, in one line.
    """
    return _Conversion(root, find).convert()


def _refuse(what: object, allowed: str) -> InputError:
    return InputError("SDF", what, allowed)


def _tag(element: ET.Element) -> str:
    return element.tag.replace(_DRAKE, "drake:")


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


def _is_true(text: str) -> bool:
    return text.strip().lower() in ("true", "1")


def _make_pose_matrix(element: ET.Element) -> Array:
    """Return the matrix of the <pose> of an element, (4, 4)."""
    matrix = np.eye(4)
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return matrix
    text = pose.text or ""
    what = f"the pose of {element.get('name', _tag(element))}"
    if pose.get("rotation_format") == "quat_xyzw":
        *place, x, y, z, w = _numbers(text, 7, what)
        rotation = Rotation.from_quat([x, y, z, w])
    else:
        *place, roll, pitch, yaw = _numbers(text, 6, what)
        degrees = _is_true(pose.get("degrees", ""))
        rotation = Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=degrees)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = place
    return matrix


def _relative_to(element: ET.Element) -> str:
    pose = element.find("pose")
    return "" if pose is None else pose.get("relative_to", "")


@dataclass(eq=False)
class _Scope:
    """The world or a model, in which names are looked up."""

    element: ET.Element
    name: str
    parent: "_Scope | None"
    members: dict[str, "ET.Element | _Scope"] = field(default_factory=dict)
    pending: set[str] = field(default_factory=set)
    """Names whose pose is being computed."""

    @property
    def static(self) -> bool:
        """Tell whether the model, or one that holds it, is fixed to the world."""
        stated = _is_true(_text(self.element, "static"))
        return stated or (self.parent is not None and self.parent.static)

    def pose(self) -> Array:
        """Return the pose of the scope's own frame in the world, (4, 4)."""
        if self.parent is None:
            return np.eye(4)
        return np.asarray(self.parent.pose() @ self.parent.locate(self.name))

    def member(self, name: str) -> "ET.Element | _Scope":
        """Return a link, joint, frame or model by its name."""
        if name not in self.members:
            raise _refuse(name, f"is no link, joint, frame or model of {self.name}")
        return self.members[name]

    def model(self, name: str) -> "_Scope":
        """Return a model by its name."""
        member = self.member(name)
        if isinstance(member, _Scope):
            return member
        raise _refuse(name, f"is no model of {self.name}")

    def locate(self, name: str) -> Array:
        """Return the pose of a member in the scope's own frame, (4, 4)."""
        if name in ("", "__model__", "world"):
            return np.eye(4)
        if "::" in name:
            first, _, rest = name.partition("::")
            return np.asarray(self.locate(first) @ self.model(first).locate(rest))
        if name in self.pending:
            raise _refuse(name, "is placed relative to itself")
        self.pending.add(name)
        member = self.member(name)
        if isinstance(member, _Scope):
            element = member.element
            placed = element.get("placement_frame", "")
            offset = np.linalg.inv(member.locate(placed))
            reference = _relative_to(element)
        else:
            offset = np.eye(4)
            reference = _relative_to(member) or self._attachment(member)
        pose = (
            self.locate(reference) @ _make_pose_matrix(self._element(member)) @ offset
        )
        self.pending.discard(name)
        return np.asarray(pose)

    @staticmethod
    def _element(member: "ET.Element | _Scope") -> ET.Element:
        return member.element if isinstance(member, _Scope) else member

    @staticmethod
    def _attachment(element: ET.Element) -> str:
        """Return the name of what a joint or frame is attached to; a link to none."""
        if element.tag == "joint":
            return _text(element, "child")
        return element.get("attached_to", "")

    def find_link(self, name: str) -> "_Link | None":
        """Return the link that a name stands for or is attached to; None: the world."""
        if name == "world":
            return None
        if "::" in name:
            first, _, rest = name.partition("::")
            return self.model(first).find_link(rest)
        if name in ("", "__model__"):
            if self.parent is None:
                return None
            return self.find_link(self._canonical_link())
        if name in self.pending:
            raise _refuse(name, "is attached to itself")
        member = self.member(name)
        if isinstance(member, _Scope):
            return member.find_link("")
        if member.tag == "link":
            return _Link(self, name)
        self.pending.add(name)
        link = self.find_link(self._attachment(member))
        self.pending.discard(name)
        return link

    def _canonical_link(self) -> str:
        """Return the name of the link that carries the model's frame."""
        stated = self.element.get("canonical_link")
        if stated:
            return stated
        for name, member in self.members.items():
            if isinstance(member, _Scope) or member.tag == "link":
                return name
        raise _refuse(self.name, "has no link")


@dataclass(frozen=True)
class _Link:
    """A link of a model."""

    scope: _Scope
    name: str

    @property
    def element(self) -> ET.Element:
        """The <link>."""
        element = self.scope.member(self.name)
        assert isinstance(element, ET.Element)
        return element

    def pose(self) -> Array:
        """Return the pose of the link in the world, (4, 4)."""
        return np.asarray(self.scope.pose() @ self.scope.locate(self.name))


class _Edge(NamedTuple):
    """Joint between two links, None: the world; or what fixes a link to it."""

    name: str
    kind: str
    scope: _Scope
    parent: _Link | None
    child: _Link | None
    element: ET.Element | None = None

    def rank(self) -> int:
        """Return how early the joint belongs to the tree: the last may close a loop.

        A ball is a connect without loss, and so is a hinge of a planar loop; damping,
        friction, a spring and a leader are lost.
        """
        if self.kind == "ball":
            return 4
        if self.element is None or self.kind not in ("revolute", "continuous"):
            return 1
        follows = self.element.find("axis/mimic") is not None
        return 2 if self.has_dynamics() or follows else 3

    def has_dynamics(self) -> bool:
        """Tell whether the joint has damping, friction or a spring."""
        return self.element is not None and any(
            float(_text(self.element, f"axis/dynamics/{name}", "0")) != 0.0
            for name in ("damping", "friction", "spring_stiffness")
        )

    def read_start(self) -> float:
        """Return <initial_position> of a joint with one axis, rad or m; 0 without."""
        if self.element is None or len(_DEGREES_OF_FREEDOM[self.kind]) != 1:
            return 0.0
        text = _text(self.element, "axis/initial_position", "0")
        return _numbers(text, 1, f"initial_position of {self.name}")[0]


class _Conversion:
    """One SDF file that is being converted."""

    def __init__(self, root: ET.Element, find: FindModel) -> None:
        self.root = root
        self.find = find
        self.links: list[_Link] = []
        self.edges: list[_Edge] = []
        self.constraints: list[tuple[_Scope, ET.Element]] = []
        self.notes: list[str] = []
        self.left_out: set[str] = set()
        self.tree: dict[_Link, tuple[_Edge | None, _Link | None]] = {}
        """Joint by which each link hangs on another, and that link."""
        self.names: dict[tuple[_Scope, str], str] = {}

    def convert(self) -> tuple[ET.Element, list[str]]:
        """Convert the file."""
        worlds = [one for one in self.root if one.tag in ("world", "model")]
        if not worlds:
            raise _refuse(self.root.tag, "holds neither a <world> nor a <model>")
        if worlds[0].tag == "world":
            world = worlds[0]
        else:
            world = ET.Element("world", {"name": "world"})
            world.extend(worlds)
        scope = _Scope(world, "world", None)
        for each in list(self._collect(scope)):
            self._read_members(each)
        self._name_members()
        self._grow_tree()
        mujoco = ET.Element("mujoco")
        ET.SubElement(mujoco, "compiler", angle="radian")
        gravity = _numbers(_text(world, "gravity", DEFAULT_GRAVITY), 3, "gravity")
        timestep = _text(world, "physics/max_step_size", DEFAULT_TIMESTEP)
        ET.SubElement(mujoco, "option", gravity=_write(gravity), timestep=timestep)
        self.asset = ET.SubElement(mujoco, "asset")
        self.body: dict[_Link | None, ET.Element]
        self.body = {None: ET.SubElement(mujoco, "worldbody")}
        for link in self.tree:
            self._add_body(link)
        self.equality = ET.SubElement(mujoco, "equality")
        self._add_closures()
        if self.left_out:
            names = ", ".join(sorted(self.left_out))
            self.notes.append(f"left out of the SDF: {names}")
        if _BUSHING in self.left_out:
            self.notes.append(
                f"{_BUSHING} joins two links by springs; if it closes the loop, put "
                "<drake:ball_constraint> in its place, a rigid pin"
            )
        return mujoco, self.notes

    def _collect(self, scope: _Scope) -> Iterator[_Scope]:
        """Read the names of a scope; yield it and the models inside."""
        yield scope
        for child in scope.element:
            tag = _tag(child)
            if tag == "drake:ball_constraint":
                self.constraints.append((scope, child))
            elif tag not in _ELEMENTS_READ | _OF_NO_FORCE:
                self.left_out.add(tag)
            if tag not in ("link", "joint", "frame", "model", "include"):
                continue
            element = self._include(child) if tag == "include" else child
            name = element.get("name", "")
            if not name or name in scope.members:
                raise _refuse(name, f"must be a name of its own, in {scope.name}")
            if element.tag == "model":
                scope.members[name] = _Scope(element, name, scope)
                yield from self._collect(scope.model(name))
            else:
                scope.members[name] = element

    def _read_members(self, scope: _Scope) -> None:
        """Read the links and joints of a scope whose names are all known."""
        for name, member in scope.members.items():
            if isinstance(member, _Scope):
                continue
            unread = {_tag(child) for child in member} - _ELEMENTS_READ - _OF_NO_FORCE
            self.left_out |= unread
            if member.tag == "link":
                self.links.append(_Link(scope, name))
                if scope.static:
                    link = self.links[-1]
                    self.edges.append(_Edge("", "fixed", scope, None, link))
            elif member.tag == "joint":
                self._read_joint(scope, name, member)

    def _read_joint(self, scope: _Scope, name: str, joint: ET.Element) -> None:
        kind = joint.get("type", "")
        if kind not in _DEGREES_OF_FREEDOM:
            self.left_out.add(f"the {kind} joint {name}")
            return
        parent, child = (
            scope.find_link(_text(joint, end)) for end in ("parent", "child")
        )
        self.edges.append(_Edge(name, kind, scope, parent, child, joint))

    def _include(self, include: ET.Element) -> ET.Element:
        """Return the model of an included file, with what the include states anew."""
        uri = _text(include, "uri")
        if _is_true(include.get("merge", "")):
            raise _refuse(uri, 'is included with merge="true", which is not read')
        model = self.find(uri).find("model")
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

    def _name_members(self) -> None:
        """Name links and joints as the file does, with models where names repeat."""
        for members in (
            [(link.scope, link.name) for link in self.links],
            [(edge.scope, edge.name) for edge in self.edges if edge.name],
        ):
            counts = Counter(name for _, name in members)
            for scope, name in members:
                models = []
                holder = scope
                while counts[name] > 1 and holder.parent is not None:
                    models.append(holder.name)
                    holder = holder.parent
                self.names[scope, name] = "::".join([*reversed(models), name])

    def _name(self, link: _Link | None) -> str:
        return "world" if link is None else self.names[link.scope, link.name]

    def _grow_tree(self) -> None:
        """Hang each link on another by a joint, from the world outwards."""
        joints = defaultdict(list)
        for number, edge in enumerate(self.edges):
            for end in (edge.parent, edge.child):
                joints[end].append((edge.rank(), number))
        reached: set[_Link | None] = set()
        for root in (None, *self.links):
            if root in reached:
                continue
            reached.add(root)
            if root is not None:
                self.tree[root] = (None, None)
            heap = [(rank, 0, number) for rank, number in joints[root]]
            heapq.heapify(heap)
            while heap:
                _, depth, number = heapq.heappop(heap)
                edge = self.edges[number]
                for link, bearer in (
                    (edge.child, edge.parent),
                    (edge.parent, edge.child),
                ):
                    if link is None or link in reached:
                        continue
                    self.tree[link] = (edge, bearer)
                    reached.add(link)
                    for rank, other in joints[link]:
                        heapq.heappush(heap, (rank, depth + 1, other))
        hanging = [edge for edge, _ in self.tree.values()]
        self.closing = [
            edge
            for edge in self.edges
            if edge.name and not any(edge is other for other in hanging)
        ]

    def _add_body(self, link: _Link) -> None:
        """Add a link as a body of the one that it hangs on."""
        edge, bearer = self.tree[link]
        pose = link.pose()
        if bearer is not None:
            pose = np.linalg.inv(bearer.pose()) @ pose
        body = ET.SubElement(self.body[bearer], "body")
        self.body[link] = body
        if edge is None:
            ET.SubElement(body, "freejoint", name=f"free joint of {self._name(link)}")
        elif edge.element is not None:
            for joint in self._list_joints(edge, link):
                pose = pose @ _move_to_start(joint)
                ET.SubElement(body, "joint", joint)
        body.attrib |= {"name": self._name(link), **_write_place(pose)}
        if _text(link.element, "gravity") in ("false", "0"):
            body.set("gravcomp", "1")
        if not link.scope.static:
            self._add_inertia(body, link)

    def _list_joints(self, edge: _Edge, link: _Link) -> Iterator[dict[str, str]]:
        """List the joints of MJCF of one joint of SDF, on the link that it carries."""
        joint = edge.element
        assert joint is not None
        name = self.names[edge.scope, edge.name]
        inside = np.linalg.inv(link.pose()) @ edge.scope.pose()
        own = edge.scope.locate(edge.name)
        place = _write((inside @ own)[:3, 3])
        if edge.kind == "ball":
            yield {"name": name, "type": "ball", "pos": place}
        axes = _DEGREES_OF_FREEDOM[edge.kind]
        start = edge.read_start()
        forwards = edge.child is not None and edge.child == link
        for tag in axes if forwards else reversed(axes):
            axis = joint.find(tag)
            if axis is None:
                axis = ET.Element(tag)
            frame = self._find_axis_frame(edge, axis)
            direction = _numbers(_text(axis, "xyz", "0 0 1"), 3, f"axis of {edge.name}")
            turned = (inside @ frame)[:3, :3] @ direction
            yield {
                "name": name if tag == "axis" else f"{name}::{tag}",
                "type": "slide" if edge.kind == "prismatic" else "hinge",
                "pos": place,
                "axis": _write(turned if forwards else -turned),
                **({"ref": repr(start)} if start else {}),
                **_read_dynamics(axis, edge.name),
            }

    def _find_axis_frame(self, edge: _Edge, axis: ET.Element) -> Array:
        """Return the pose in the model of the frame in which an axis is stated."""
        xyz = axis.find("xyz")
        named = "" if xyz is None else xyz.get("expressed_in", "")
        if named:
            return edge.scope.locate(named)
        if _is_true(_text(axis, "use_parent_model_frame")):
            return np.eye(4)
        return edge.scope.locate(edge.name)

    def _add_inertia(self, body: ET.Element, link: _Link) -> None:
        """Add mass and inertia, as stated or of collisions; SDF's own are of size 1."""
        name = self._name(link)
        inertial = link.element.find("inertial")
        if inertial is None:
            inertial = ET.Element("inertial")
        if _is_true(inertial.get("auto", "")):
            if inertial.find("mass") is not None:
                raise _refuse(name, 'states a <mass> beside auto="true": not read')
            self._add_collisions(body, link, _text(inertial, "density"))
            return
        pose = _make_pose_matrix(inertial)
        rotation = pose[:3, :3]
        xx, yy, zz, xy, xz, yz = (
            _numbers(
                _text(inertial, f"inertia/i{part}", "1" if part in _DIAGONAL else "0"),
                1,
                f"i{part} of {name}",
            )[0]
            for part in (*_DIAGONAL, "xy", "xz", "yz")
        )
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if xy or xz or yz or not np.array_equal(rotation, np.eye(3)):
            tensor = rotation @ tensor @ rotation.T
            numbers = [*np.diagonal(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
            stated = {"fullinertia": _write(numbers)}
        else:
            stated = {"diaginertia": _write([xx, yy, zz])}
        place = _write(pose[:3, 3])
        (mass,) = _numbers(_text(inertial, "mass", "1"), 1, f"mass of {name}")
        if mass <= 0.0:
            raise _refuse(mass, f"must be above 0: the mass of {name}, kg")
        ET.SubElement(body, "inertial", {"pos": place, "mass": repr(mass), **stated})

    def _add_collisions(self, body: ET.Element, link: _Link, density: str) -> None:
        """Add a link's collisions as geoms, from which MuJoCo computes its inertia."""
        inside = np.linalg.inv(link.scope.locate(link.name))
        for collision in link.element.findall("collision"):
            shape = collision.find("geometry/*")
            if shape is None or shape.tag == "plane":
                continue
            reference = _relative_to(collision) or link.name
            pose = inside @ link.scope.locate(reference) @ _make_pose_matrix(collision)
            own = _text(collision, "density", density or DEFAULT_DENSITY)
            place = {**_write_place(pose), "density": own}
            ET.SubElement(body, "geom", {**self._read_shape(shape), **place})
        if body.find("geom") is None:
            reason = 'has no collision that its inertial auto="true" could be that of'
            raise _refuse(self._name(link), reason)

    def _read_shape(self, shape: ET.Element) -> dict[str, str]:
        """Return type and size of a geom."""
        tag = _tag(shape)
        if tag == "mesh":
            number = len(self.asset)
            scale = _write(_numbers(_text(shape, "scale", "1 1 1"), 3, "scale"))
            file = _text(shape, "uri").partition("://")[2] or _text(shape, "uri")
            ET.SubElement(
                self.asset, "mesh", name=f"mesh {number}", file=file, scale=scale
            )
            return {"type": "mesh", "mesh": f"mesh {number}"}
        if tag not in _SIZES:
            raise _refuse(tag, f"has no inertia here; read are {', '.join(_SIZES)}")
        sizes = [
            factor * number
            for name, count, factor in _SIZES[tag]
            for number in _numbers(_text(shape, name), count, f"{name} of {tag}")
        ]
        return {"type": tag, "size": _write(sizes)}

    def _add_closures(self) -> None:
        """Add what closes loops, and the joints that follow others."""
        for edge in self.closing:
            name = self.names[edge.scope, edge.name]
            if edge.kind == "fixed":
                ET.SubElement(
                    self.equality,
                    "weld",
                    name=name,
                    body1=self._name(edge.parent),
                    body2=self._name(edge.child),
                )
                continue
            if edge.kind not in ("revolute", "continuous", "ball"):
                self.left_out.add(f"the {edge.kind} joint {edge.name} of a loop")
                continue
            place = (edge.scope.pose() @ edge.scope.locate(edge.name))[:3, 3]
            self._connect(name, {edge.parent: place, edge.child: place})
            lost = "; its damping, friction and spring are lost"
            self.notes.append(
                f"{name} closes a loop: it is a <connect>, which holds its point "
                f"and not its axis{lost if edge.has_dynamics() else ''}"
            )
        for scope, constraint in self.constraints:
            self._add_ball_constraint(scope, constraint)
        for edge in self.edges:
            self._add_mimic(edge)

    def _add_ball_constraint(self, scope: _Scope, constraint: ET.Element) -> None:
        places = {}
        for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
            start = f"{_DRAKE}ball_constraint_"
            link = scope.find_link(_text(constraint, f"{start}{body}"))
            text = _text(constraint, f"{start}{point}")
            place = _numbers(text, 3, f"ball_constraint_{point}")
            pose = np.eye(4) if link is None else link.pose()
            places[link] = (pose @ [*place, 1.0])[:3]
        if len(places) != 2:
            raise _refuse("drake:ball_constraint", "must join two bodies")
        self._connect("-".join(map(self._name, places)), places)

    def _connect(self, name: str, places: dict[_Link | None, Array]) -> None:
        """Connect two links at their places, (3,) each, m, in the world."""
        connect = ET.SubElement(self.equality, "connect", name=name)
        for number, (link, place) in enumerate(places.items(), 1):
            pose = np.eye(4) if link is None else link.pose()
            inside = np.linalg.inv(pose) @ [*place, 1.0]
            site = {"name": f"{name} {number}", "pos": _write(inside[:3])}
            ET.SubElement(self.body[link], "site", site)
            connect.set(f"site{number}", site["name"])

    def _add_mimic(self, edge: _Edge) -> None:
        """Add the line by which a joint follows another."""
        if edge.element is None or edge in self.closing:
            return
        for mimic in edge.element.findall("axis/mimic"):
            leader = mimic.get("joint", "")
            multiplier, offset, reference = (
                _numbers(_text(mimic, name, default), 1, f"{name} of {edge.name}")[0]
                for name, default in (
                    ("multiplier", "1"),
                    ("offset", "0"),
                    ("reference", "0"),
                )
            )
            # MuJoCo's polynomial counts both joints from where they start
            start = sum(
                other.read_start()
                for other in self.edges
                if (other.scope, other.name) == (edge.scope, leader)
            )
            constant = offset + multiplier * (start - reference) - edge.read_start()
            ET.SubElement(
                self.equality,
                "joint",
                joint1=self.names[edge.scope, edge.name],
                joint2=self.names.get((edge.scope, leader), leader),
                polycoef=_write([constant, multiplier, 0.0, 0.0, 0.0]),
            )


_DIAGONAL = ("xx", "yy", "zz")
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
        ("dynamics/damping", "damping"),
        ("dynamics/friction", "frictionloss"),
        ("dynamics/spring_stiffness", "stiffness"),
        ("dynamics/spring_reference", "springref"),
    ):
        (number,) = _numbers(_text(axis, tag, "0"), 1, f"{tag} of {name}")
        if number:
            attributes[attribute] = repr(number)
    lower, upper = (_read_limit(axis, end, name) for end in ("lower", "upper"))
    if lower is not None or upper is not None:
        low = -_WIDEST if lower is None else lower
        high = _WIDEST if upper is None else upper
        attributes["range"] = _write([low, high])
    return attributes


def _move_to_start(joint: dict[str, str]) -> Array:
    """Return the motion of a link by the `ref` of its joint in MJCF, (4, 4)."""
    matrix = np.eye(4)
    start = float(joint.get("ref", "0"))
    if not start:
        return matrix
    axis, place = (np.array(joint[name].split(), float) for name in ("axis", "pos"))
    axis /= np.linalg.norm(axis)
    if joint["type"] == "slide":
        matrix[:3, 3] = start * axis
    else:
        matrix[:3, :3] = Rotation.from_rotvec(start * axis).as_matrix()
        matrix[:3, 3] = place - matrix[:3, :3] @ place
    return matrix


def _read_limit(axis: ET.Element, end: str, name: str) -> float | None:
    """Return a limit of an axis, rad or m; None if there is none."""
    text = _text(axis, f"limit/{end}", "inf")
    if text.lstrip("+-") == "inf":
        return None
    (limit,) = _numbers(text, 1, f"limit of {name}")
    return None if abs(limit) >= UNBOUNDED else limit


def _write_place(pose: Array) -> dict[str, str]:
    """Return place and orientation as attributes of MJCF."""
    turned = Rotation.from_matrix(pose[:3, :3])
    quaternion = turned.as_quat(scalar_first=True)
    return {"pos": _write(pose[:3, 3]), "quat": _write(quaternion)}


def _write(numbers: Array | list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)

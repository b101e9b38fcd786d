"""A robot's file is data: read with limits, and handed on only as what was screened.

Includes are put in place, every mesh is read here and gets a plain name, and what is
for the eye alone is left out. The text that the engine gets is written anew from the
elements that were looked at, so nothing can mean one thing to the reader here and
another to the engine's.
"""

import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

from fourbar.errors import InputError
from fourbar.writing import read_text
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotFile

_DROPPED = r"<!--.*?-->|<\?.*?\?>|<![a-z][^>]*>|[\x01-\x08\x0b\x0c\x0e-\x1f]"
"""Comments, declarations and control characters, which MuJoCo's reader lets stand
anywhere.
"""
_NAMESPACE = r"""\sxmlns\s*=\s*("[^"]*"|'[^']*')"""
"""Namespace of all elements. Simulators take it for an attribute."""
_PREFIX = r"[<\s](?!xml)([a-zA-Z]\w*):"
_NO_ENTITY = r"&(?!(?:#\d+|#x[\da-fA-F]+|amp|lt|gt|quot|apos);)"
_UNREAD = dict.fromkeys(
    (".usd", ".usda", ".usdc", ".usdz"),
    "is a USD: give the robot's MJCF, SDF or URDF, or the pins of its loop to fourbar"
    " new --pins",
) | {".mjb": "is a compiled model: give the MJCF that it was compiled from"}
"""What is said of a file that is not read, by its suffix."""
_KINDS = {"mujoco": "MJCF", "sdf": "SDF", "robot": "URDF"}
"""Format of a file, by its outermost element."""
_KINDS_BY_NAME = {".sdf": "SDF", ".world": "SDF", ".urdf": "URDF"}
"""Format of a file that is not parsed yet, by its suffix; others are MJCF."""
LARGEST_TEXT = 16 * 2**20
"""Bytes of a file and its includes; a humanoid takes half a million."""
LARGEST_ASSETS = 512 * 2**20
"""Bytes of all meshes."""
_DEEPEST = 100
"""Nested elements; the readers of XML recurse."""
MOST_INCLUDES = 200
NOT_THERE = (
    "is not there; it must lie in the folder of the file, in a folder beside it, or in "
    "that of --assets DIR"
)
_TURNING = ("revolute", "continuous", "spherical", None)
"""Types of a pin that closes a loop of a URDF; Drake's states none."""
_LOOP_JOINT = (
    '<loop_joint name="B" type="revolute"> <link1 link="ONE" xyz="0 0 0"/> <link2'
    ' link="TWO" xyz="0 0 0"/> </loop_joint>'
)
_STAND_IN = {"vertex": "0 0 0 .001 0 0 0 .001 0 0 0 .001", "scale": "1 1 1"}
"""Tetrahedron of a millimetre in the place of a mesh that is missing, of which a body
that moves gets a mass of 0.2 mg.
"""
_REACHING_OUT = ("attach", "model")
"""Elements that load other models, in which a loop may be."""
_FOR_THE_EYE = ("texture", "skin", "layer", "sensor")
"""Elements that are dropped without a word; so is every attribute `texture`."""
_LEFT_OUT = (
    "extension",
    "plugin",
    "composite",
    "flexcomp",
    "flex",
    "deformable",
    "flexvert",
    "flexstrain",
    "hfield",
)
"""Elements that are dropped and named: plugins, deformable bodies and height fields."""
FOLDER_ATTRIBUTES = ("assetdir", "meshdir", "texturedir")
"""Attributes of <compiler> that name folders of assets; the later ones go first."""
FILE_ATTRIBUTES = ("file", "directory", "content_type")
"""Attributes that name files."""
_COUNTS = (
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "ccd_iterations",
    "sdf_iterations",
    "sdf_initpoints",
)
_MOST_ITERATIONS = 1000
"""Upper limit of each count in <option>, ten times the greatest of MuJoCo's defaults:
MuJoCo already steps while it compiles, and with a tolerance of 0 nothing else may stop
a solver.
"""


def read_robot(path: Path, assets: Path | None = None) -> RobotFile:
    """Read a robot's file with its includes and meshes.

    Parameters
    ----------
    assets : a further folder in which includes and meshes are looked for.

    Raises
    ------
    InputError : what the file may not hold, or names and is not there, in one line.
    """
    return _RobotReading(path, assets).read()


def mend_text(text: str) -> str:
    """Return a text as XML where MuJoCo's reader asks for less.

    Comments are dropped, since two hyphens may stand in them, and so are declarations,
    control characters and what stands before the first element; attributes get a blank
    between them and may hold "<"; an ampersand that begins no entity is one; a prefix
    that nothing binds, like that of Drake's elements, stands for itself.
    """
    text = re.sub(_DROPPED, "", text, flags=re.DOTALL)
    text = text[text.find("<") :]
    text = re.sub(
        r"""=\s*(?:"[^"]*"|'[^']*')""",
        lambda attribute: attribute[0].replace("<", "&lt;") + " ",
        text,
    )
    text = re.sub(_NO_ENTITY, "&amp;", text)
    used, bound = (set(re.findall(one, text)) for one in (_PREFIX, r"xmlns:(\w+)"))
    spaces = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in sorted(used - bound))
    return re.sub(r"<\w+", rf"\g<0>{spaces}", text, count=1)


@dataclass
class _RobotReading:
    """One robot that is being read, with the files that it names."""

    path: Path
    assets: Path | None
    size: int = 0
    included: int = 0
    contents: dict[str, bytes] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    kind: str = field(init=False)
    """Format of the file, which begins each message about it."""

    def __post_init__(self) -> None:
        """Tell the format by the name."""
        self.kind = _KINDS_BY_NAME.get(self.path.suffix.lower(), "MJCF")

    def read(self) -> RobotFile:
        """Read and screen everything."""
        if self.assets is not None and not self.assets.is_dir():
            raise InputError("--assets", str(self.assets), "must be a folder")
        if other := _UNREAD.get(self.path.suffix.lower()):
            raise self._refuse(self.path.name, other)
        root = self._parse(self.path)
        if root.tag not in _KINDS:
            raise self._refuse(
                root.tag,
                "must be an MJCF, an SDF or a URDF, whose outermost element is "
                "<mujoco>, <sdf> or <robot>",
            )
        self.kind = _KINDS[root.tag]
        if self.kind == "SDF":
            root = self._convert_sdf(root)
        elif self.kind == "URDF":
            self._reduce_urdf(root)
        self._expand(root, self.path, 0)
        self._take_meshes(root)
        self._drop_pictures(root)
        for element in root.iter():
            self._screen(element)
        text = ET.tostring(root, encoding="unicode")
        notes = tuple(self.notes)
        return RobotFile(self.path, text, self.kind, self.contents, self.missing, notes)

    def _convert_sdf(self, root: ET.Element) -> ET.Element:
        """Return an SDF as MJCF; its includes lie in its folder or beside it."""
        from fourbar_validation.robots.sdf import MissingModelError, convert_sdf

        home = self.path.resolve().parent

        def find(uri: str) -> ET.Element:
            name = uri.rpartition("://")[2]
            for candidate in (name, f"{name}/model.sdf"):
                path = self._find(candidate, (home, home.parent))
                if path is not None:
                    return self._include(path, name)
            raise MissingModelError(self.kind, f"<uri>{uri}</uri>", NOT_THERE)

        try:
            root, notes = convert_sdf(root, find)
        except InputError as error:
            raise InputError(
                error.key, error.value, error.allowed, str(self.path)
            ) from None
        self.notes += notes
        return root

    def _reduce_urdf(self, root: ET.Element) -> None:
        """Leave what MuJoCo's own reader of URDF needs: inertias and joints."""
        pins = self._take_pins(root)
        kept = ("link", "joint", "material", "mujoco", "compiler", "option")
        stated = root.findall("mujoco/*")
        others = [child for child in [*root, *stated] if child.tag not in kept]
        joining = [
            one
            for one in others
            if len({end.tag for end in one.findall("*[@link]")}) > 1
        ]
        left_out = {child.tag for child in others if child not in joining}
        if any("xacro}" in tag for tag in left_out):
            raise self._refuse(
                self.path.name, 'is a xacro: "xacro FILE > robot.urdf" writes its URDF'
            )
        closing = [one.get("name", "") for one in root.findall("gazebo/joint")]
        root[:] = [child for child in root if child.tag in ("link", "joint")] + pins
        for link in root.iter("link"):
            link[:] = link.findall("inertial")
        settings = ET.SubElement(root, "mujoco")
        settings.extend(one for one in stated if one.tag in ("compiler", "option"))
        self._refuse_cycles(root)
        if left_out:
            self.notes.append(f"left out of the URDF: {', '.join(sorted(left_out))}")
        self.notes += [
            f"<{one.tag}> {one.get('name', 'without a name')} joins two links, but is"
            " left out"
            for one in joining
        ]
        if closing:
            self.notes.append(
                "a joint in <gazebo> may close a loop, but is no URDF"
                f" ({', '.join(closing)}): "
                '"gz sdf -p FILE > robot.sdf" writes an SDF that has it'
            )
        if pins:
            return
        self.notes.append(
            f"no loop is closed in this URDF: {_LOOP_JOINT} closes one, with the pin's"
            " place in each link; where a mimic joint stands for a loop, check-mjcf"
            " SCENE FILE --mimic JOINT judges it"
        )

    def _refuse_cycles(self, root: ET.Element) -> None:
        """Name a joint between links that other joints join, or that are not there."""
        known = {link.get("name") for link in root.iter("link")}
        joined = dict[str, set[str]]()
        for joint in root.findall("joint"):
            ends = [end.attrib["link"] for end in joint.findall("*[@link]")]
            if not known.issuperset(ends):
                raise self._refuse(
                    joint.get("name"),
                    f"joins {' and '.join(ends)}, which must both be links of the file",
                )
            groups = [joined.get(end, {end}) for end in ends]
            together = set[str]().union(*groups)
            if len(together) < sum(map(len, groups)):
                raise self._refuse(
                    joint.get("name"),
                    f"closes a loop at {' and '.join(ends)}, but joints of a URDF are a"
                    f" tree: write {_LOOP_JOINT} in its place, with the pin's place in"
                    " each link",
                )
            joined |= dict.fromkeys(together, together)

    def _take_pins(self, root: ET.Element) -> list[ET.Element]:
        """Return the pins that close loops, which MuJoCo's own reader passes over.

        Such a pin is the <loop_joint> of Isaac Sim, in whose form Drake's
        <drake:ball_constraint> is written.
        """
        for ball in root.findall("{*}ball_constraint"):
            ball.tag = "loop_joint"
            bodies, points = (ball.findall(f"*[@{key}]") for key in ("name", "value"))
            for body, point in zip(bodies, points, strict=False):
                body.attrib["link"] = body.attrib["name"]
                body.attrib["xyz"] = point.attrib["value"]
        known = {link.get("name") for link in root.iter("link")}
        pins = [
            pin for pin in root.findall("loop_joint") if pin.get("type") in _TURNING
        ]
        for pin in pins:
            links = [end.attrib["link"] for end in pin.findall("*[@link][@xyz]")]
            name = pin.get("name") or "-".join(links)
            if len(links) != 2 or not known.issuperset(links):
                raise self._refuse(
                    name,
                    "must name two links, with the pin's x, y and z in each:"
                    f" {_LOOP_JOINT}",
                )
            self.notes.append(
                f"{name} closes a loop: it is a <connect>, which holds its point and "
                "not its axis"
            )
            root.remove(pin)
            # what it states besides is named as left out
            root.extend([*pin.iter("dynamics"), *pin.iter("limit")])
        return pins

    def _refuse(self, what: object, allowed: str) -> InputError:
        return InputError(self.kind, what, allowed, str(self.path))

    def _parse(self, path: Path) -> ET.Element:
        """Parse one file; no document type, no depth without bound."""
        text = read_text(path, self.kind, LARGEST_TEXT)
        self.size += len(text)
        if self.size > LARGEST_TEXT:
            raise self._refuse(path.name, f"and its includes exceed {LARGEST_TEXT} B")
        try:
            return self._parse_text(text, path)
        except (ET.ParseError, ValueError) as caught:
            error = str(caught)
        try:
            root = self._parse_text(mend_text(text), path)
        except (ET.ParseError, ValueError):
            raise self._refuse(path.name, f"is no XML: {error}") from None
        if not error.startswith("unbound prefix"):  # as in every SDF of Drake's
            self.notes.append(
                f"{path.name} is no XML ({error}), but read as simulators read it"
            )
        return root

    def _parse_text(self, text: str, path: Path) -> ET.Element:
        for word in ("<!DOCTYPE", "<!ENTITY"):
            if word in text.upper():
                raise self._refuse(
                    word, "is not allowed: the file needs no document type"
                )
        plain = re.sub(_NAMESPACE, "", text)
        parsed = ET.iterparse(io.StringIO(plain), ("start", "end"))
        depth = 0
        for event, _ in parsed:
            depth += 1 if event == "start" else -1
            if depth > _DEEPEST:
                raise self._refuse(
                    path.name, f"nests its elements deeper than {_DEEPEST}"
                )
        root: ET.Element = parsed.root  # type: ignore[attr-defined]
        return root

    def _expand(
        self,
        element: ET.Element,
        inside: Path,
        depth: int,
    ) -> None:
        """Put the contents of each included file in the place of <include>."""
        if depth > _DEEPEST:
            raise self._refuse(self.path.name, f"is nested deeper than {_DEEPEST}")
        for place, child in reversed(list(enumerate(element))):
            if child.tag != "include":
                self._expand(child, inside, depth + 1)
                continue
            name = child.get("file", "")
            # MuJoCo counts from the folder of the main file
            path = self._find(name, (self.path.parent, inside.parent))
            if path is None:
                raise self._refuse(f'<include file="{name}">', NOT_THERE)
            content = self._include(path, name)
            if content.tag not in ("mujoco", "mujocoinclude"):
                raise self._refuse(content.tag, f"must be <mujocoinclude>, in {name}")
            self._expand(content, path, depth + 1)
            element[place : place + 1] = list(content)

    def _include(self, path: Path, name: str) -> ET.Element:
        """Parse an included file."""
        self.included += 1
        if self.included > MOST_INCLUDES:
            raise self._refuse(name, f"more than {MOST_INCLUDES} files are included")
        return self._parse(path)

    def _find(self, name: str, folders: tuple[Path, ...]) -> Path | None:
        """Find a file that may be read, in these folders or that of --assets."""
        if not name or "\0" in name:
            return None
        candidates = [folder / name for folder in folders]
        if self.assets is not None:
            candidates += [self.assets / name, self.assets / Path(name).name]
        for candidate in candidates:
            try:
                resolved = candidate.resolve()
                if self._may_read(resolved) and resolved.is_file():
                    return resolved
            except (OSError, RuntimeError):  # no name of a file, or links in a circle
                continue
        return None

    def _may_read(self, resolved: Path) -> bool:
        """Return whether a file lies in a folder that may be read.

        Such a folder is that of the robot's file, one beside it, or that of --assets.
        """
        home = self.path.resolve().parent
        if resolved.is_relative_to(home):
            return True
        beside = home.parent
        if beside != beside.parent and resolved.is_relative_to(beside):
            return resolved.parent != beside
        assets = self.assets
        return assets is not None and resolved.is_relative_to(assets.resolve())

    def _take_meshes(self, root: ET.Element) -> None:
        """Read each mesh, and give its file a plain name in the text."""
        folder = ""
        strip = ""
        for compiler in root.iter("compiler"):
            for name in FOLDER_ATTRIBUTES[:2]:
                folder = compiler.attrib.pop(name, folder)
            compiler.attrib.pop("texturedir", None)
            strip = compiler.attrib.pop("strippath", strip)
        total = 0
        for number, mesh in enumerate(root.iter("mesh")):
            file = mesh.attrib.pop("file", None)
            if file is None and mesh.find("plugin") is not None:
                file = f"{mesh.get('name', 'mesh')} of a plugin"
            if file is None:
                continue
            mesh.attrib.pop("content_type", None)
            mesh.set("name", mesh.get("name", Path(file).stem))
            name = Path(file).name if strip.lower() == "true" else file
            plain = f"mesh_{number}"
            suffix = Path(file).suffix.lower()
            if re.fullmatch("[.][a-z]+", suffix):
                plain += suffix
            mesh.set("file", plain)
            path = self._find(name, (self.path.parent / folder, self.path.parent))
            if path is None:
                self.missing[mesh.attrib["name"]] = file
                mesh.attrib = {"name": mesh.attrib["name"], **_STAND_IN}
                continue
            total += path.stat().st_size
            if total > LARGEST_ASSETS:
                raise self._refuse(file, f"and other meshes exceed {LARGEST_ASSETS} B")
            self.contents[plain] = path.read_bytes()

    def _drop_pictures(self, root: ET.Element) -> None:
        """Drop what only draws or measures, and what no loop of rigid bars is made of.

        A mesh or a geom that a plugin shapes counts as a mesh that is missing.
        """
        left_out = set[str]()
        for parent in root.iter():
            for child in list(parent):
                if child.tag in _LEFT_OUT or "hfield" in child.attrib:
                    left_out.add("hfield" if "hfield" in child.attrib else child.tag)
                elif child.tag not in _FOR_THE_EYE:
                    continue
                parent.remove(child)
            parent.attrib.pop("texture", None)
            if parent.tag == "geom" and parent.get("type") == "sdf":
                parent.set("type", "mesh")
        if left_out:
            names = ", ".join(f"<{tag}>" for tag in sorted(left_out))
            self.notes.append(f"left out, as no part of a loop: {names}")

    def _screen(self, element: ET.Element) -> None:
        """Refuse what reaches beyond the files that were read, or may never end."""
        if element.tag in _REACHING_OUT:
            raise self._refuse(
                f"<{element.tag}>",
                "is not read here: save the model as MuJoCo compiles it, with what it"
                " attaches in it (mj_saveLastXML), and give that file",
            )
        for name in element.attrib:
            if element.tag == "option" and name in _COUNTS:
                count = element.attrib[name].strip()
                whole = re.fullmatch("[0-9]{1,9}", count)
                if not whole or int(count) > _MOST_ITERATIONS:
                    raise self._refuse(
                        f'<option {name}="{count}">',
                        f"must be a whole number up to {_MOST_ITERATIONS}: MuJoCo "
                        "might never come back",
                    )
            if name.startswith(FILE_ATTRIBUTES) and element.tag != "mesh":
                raise self._refuse(
                    f"<{element.tag} {name}=...>", "is not allowed: it names a file"
                )

"""Writes docs/architecture.svg: the layers of both packages, by their imports.

`python docs/architecture.py` runs it.
"""

import ast
import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).with_suffix(".svg")
PACKAGES = {
    "fourbar": ROOT / "fourbar",
    "fourbar_validation": ROOT / "validation" / "fourbar_validation",
}
WIDTH, HEIGHT, UP = 100, 30, 62
"""px: of a box, and from one floor of the taller package to the next."""
GAP, LANE, PORT = 16, 10, 14
"""px: between boxes, width of an arrow that passes a floor, between ends of arrows."""
MARGIN, BETWEEN, HEAD = 16, 56, 60
"""px: around the picture, between the packages, and above the highest floor."""
SWEEPS = 24
"""Passes over the floors in which boxes move towards what they are joined to."""
Uses = dict[str, set[str]]
"""The layers that each layer imports."""
Route = tuple[str, ...]
"""Layer, the places at which an arrow passes the floors below it, and lower layer."""


def imports(tree: ast.AST) -> Iterator[ast.stmt]:
    """Find what a module imports when it runs, inside functions too."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif not (
            isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        ):
            yield from imports(node)


def uses(package: str) -> Uses:
    """Find which layers each layer imports, inside functions too.

    A layer is a folder or a module of the package.
    """
    top = PACKAGES[package]
    imported: Uses = defaultdict(set)
    for path in sorted(top.rglob("*.py")):
        layer = path.relative_to(top).parts[0].removesuffix(".py")
        if layer.startswith("__"):
            continue
        imported[layer] |= set()
        for node in imports(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [
                    node.module,
                    *(f"{node.module}.{alias.name}" for alias in node.names),
                ]
            else:
                names = (
                    [alias.name for alias in node.names]
                    if isinstance(node, ast.Import)
                    else []
                )
            imported[layer] |= {
                name.split(".")[1] for name in names if name.startswith(f"{package}.")
            } - {layer}
    return {layer: used & imported.keys() for layer, used in imported.items()}


def floors(imported: Uses) -> dict[str, int]:
    """Number the floors from the ground: a layer stands above all that it imports."""
    height: dict[str, int] = {}
    while len(height) < len(imported):
        free = [
            layer
            for layer in imported
            if layer not in height and imported[layer] <= height.keys()
        ]
        assert free, (
            f"imports run in a circle among {sorted(imported.keys() - height.keys())}"
        )
        height |= {
            layer: 1 + max((height[used] for used in imported[layer]), default=-1)
            for layer in free
        }
    return height


def direct(imported: Uses) -> Uses:
    """Leave out the imports of a layer that follow from its other imports."""

    def below(layer: str) -> set[str]:
        return imported[layer].union(*(below(used) for used in imported[layer]))

    return {
        layer: used - set().union(*(below(name) for name in used))
        for layer, used in imported.items()
    }


def routes(imported: Uses, height: dict[str, int]) -> list[Route]:
    """Find the way of every arrow, with a place on each floor that it passes."""
    return [
        (
            layer,
            *(
                f"{layer}>{lower}>{floor}"
                for floor in range(height[layer] - 1, height[lower], -1)
            ),
            lower,
        )
        for layer, used in sorted(direct(imported).items())
        for lower in sorted(used)
    ]


def arrange(height: dict[str, int], ways: list[Route]) -> dict[str, float]:
    """Place boxes and passing arrows across, px: each near to what it is joined to."""
    floor_of = dict(height)
    joined: dict[str, list[str]] = defaultdict(list)
    for way in ways:
        for step, (upper, lower) in enumerate(pairwise(way)):
            joined[upper].append(lower)
            joined[lower].append(upper)
            floor_of.setdefault(upper, height[way[0]] - step)
    rows: dict[int, list[str]] = defaultdict(list)
    for name, floor in floor_of.items():
        rows[floor].append(name)
    x = {
        name: float(WIDTH * place)
        for row in rows.values()
        for place, name in enumerate(sorted(row))
    }
    for sweep in range(SWEEPS):
        for floor in sorted(rows, reverse=sweep % 2 == 0):
            near = {
                name: sum(x[other] for other in joined[name]) / len(joined[name])
                if joined[name]
                else x[name]
                for name in rows[floor]
            }
            x |= space(sorted(rows[floor], key=lambda name: (near[name], name)), near)
    return x


def space(row: list[str], near: dict[str, float]) -> dict[str, float]:
    """Place a row from left to right, none over another, as near as possible."""
    placed: dict[str, float] = {}
    edge = -math.inf
    for name in row:
        half = (LANE if ">" in name else WIDTH) / 2
        placed[name] = max(near[name], edge + GAP + half)
        edge = placed[name] + half
    shift = sum(placed[name] - near[name] for name in row) / len(row)
    return {name: place - shift for name, place in placed.items()}


def spread(ends: list[tuple[float, Route]]) -> dict[Route, float]:
    """Spread the ends of arrows along a side of a box, ordered by their origins."""
    return {
        way: PORT * (place - (len(ends) - 1) / 2)
        for place, (_, way) in enumerate(sorted(ends))
    }


def draw_way(
    way: Route,
    x: dict[str, float],
    y: dict[str, float],
    ports: tuple[float, float],
) -> str:
    """Draw an arrow: upright where it passes a floor, and curved between floors."""
    u, v = x[way[0]] + ports[0], y[way[0]] + HEIGHT / 2
    path = f"M{u:.0f} {v:.0f}"
    for name in way[1:]:
        last = name == way[-1]
        to, down = x[name] + (ports[1] if last else 0.0), y[name] - HEIGHT / 2
        bend = (down - v) / 2
        path += (
            f" C{u:.0f} {v + bend:.0f} {to:.0f} {down - bend:.0f} {to:.0f} {down:.0f}"
        )
        if not last:
            path += f" V{down + HEIGHT:.0f}"
        u, v = to, down + HEIGHT
    return f'<path marker-end="url(#head)" d="{path}"/>'


def text() -> str:
    """Draw the picture; both packages are as tall as the taller one."""
    parts, left = [], float(MARGIN)
    columns = {package: (uses(package), floors(uses(package))) for package in PACKAGES}
    tall = UP * max(max(height.values()) for _, height in columns.values())
    for package, (imported, height) in columns.items():
        ways = routes(imported, height)
        x = arrange(height, ways)
        least = min(x[name] for name in height) - WIDTH / 2
        least = min(least, *(place - LANE / 2 for place in x.values()))
        x = {name: place - least + left for name, place in x.items()}
        right = max(
            place + (LANE if ">" in name else WIDTH) / 2 for name, place in x.items()
        )
        step = tall / max(height.values())
        y = {name: HEAD + tall - step * floor for name, floor in height.items()}
        for way in ways:
            for count, name in enumerate(way[1:-1], 1):
                y[name] = HEAD + tall - step * (height[way[0]] - count)
        starts = {
            name: spread([(x[way[1]], way) for way in ways if way[0] == name])
            for name in height
        }
        stops = {
            name: spread([(x[way[-2]], way) for way in ways if way[-1] == name])
            for name in height
        }
        middle = (left + right) / 2
        parts.append(f'<text class="package" x="{middle:.0f}" y="24">{package}</text>')
        parts += [
            draw_way(way, x, y, (starts[way[0]][way], stops[way[-1]][way]))
            for way in ways
        ]
        for name in height:
            box = (
                f'x="{x[name] - WIDTH / 2:.0f}" y="{y[name] - HEIGHT / 2:.0f}"'
                f' width="{WIDTH}" height="{HEIGHT}" rx="5"'
            )
            at = f'x="{x[name]:.0f}" y="{y[name] + 4:.0f}"'
            parts.append(f"<rect {box}/><text {at}>{name}</text>")
        left = right + BETWEEN
    style = (
        "text{font:13px sans-serif;text-anchor:middle;fill:#1b2733}"
        ".package{font-weight:bold;font-size:15px}"
        "rect{fill:#eef3f8;stroke:#5b7a99}path{fill:none;stroke:#5b7a99;stroke-width:1.3}"
        "#head path{fill:#5b7a99;stroke:none}"
        "@media(prefers-color-scheme:dark){text{fill:#dfe7ee}rect{fill:#24323f}"
        "rect,path{stroke:#86a5c3}#head path{fill:#86a5c3}}"
    )
    head = (
        '<marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8"'
        ' markerHeight="8" markerUnits="userSpaceOnUse" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z"/></marker>'
    )
    wide, high = left - BETWEEN + MARGIN, HEAD + tall + HEIGHT / 2 + MARGIN
    size = f'width="{wide:.0f}" height="{high:.0f}" viewBox="0 0 {wide:.0f} {high:.0f}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{style}</style>\n'
        f"<defs>{head}</defs>\n" + "\n".join(parts) + "\n</svg>\n"
    )


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")

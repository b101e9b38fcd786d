"""Writes docs/architecture.svg: the layers of both packages, by their imports.

`python docs/architecture.py` runs it.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).with_suffix(".svg")
PACKAGES = {
    "fourbar": ROOT / "fourbar",
    "fourbar_validation": ROOT / "validation" / "fourbar_validation",
}
WIDTH, HEIGHT, ACROSS, UP = 112, 30, 128, 66
"""px: of a box, and from one box to the next."""
Uses = dict[str, set[str]]
"""The layers that each layer imports."""


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


def text() -> str:
    """Draw the picture."""
    parts, margin = [], 20.0
    columns = {package: (uses(package), floors(uses(package))) for package in PACKAGES}
    top = 60 + UP * max(max(height.values()) for _, height in columns.values())
    for package, (imported, height) in columns.items():
        rows = [
            [layer for layer in sorted(imported) if height[layer] == floor]
            for floor in range(1 + max(height.values()))
        ]
        wide = max(map(len, rows)) * ACROSS
        place = {
            layer: (
                margin + (wide - len(row) * ACROSS) / 2 + ACROSS * (i + 0.5),
                top - UP * floor,
            )
            for floor, row in enumerate(rows)
            for i, layer in enumerate(row)
        }
        parts.append(
            f'<text class="package" x="{margin + wide / 2:.0f}" y="24">{package}</text>'
        )
        for layer, used in direct(imported).items():
            for lower in sorted(used):
                (x, y), (u, v) = place[layer], place[lower]
                y, v = y + HEIGHT / 2, v - HEIGHT / 2
                parts.append(
                    f'<path d="M{x:.0f} {y:.0f}'
                    f' C{x:.0f} {y + 24:.0f} {u:.0f} {v - 24:.0f} {u:.0f} {v:.0f}"/>'
                )
        for layer, (x, y) in place.items():
            box = (
                f'x="{x - WIDTH / 2:.0f}" y="{y - HEIGHT / 2:.0f}" width="{WIDTH}"'
                f' height="{HEIGHT}" rx="5"'
            )
            parts.append(
                f'<rect {box}/><text x="{x:.0f}" y="{y + 4:.0f}">{layer}</text>'
            )
        margin += wide + 40
    style = (
        "text{font:13px sans-serif;text-anchor:middle;fill:#1b2733}"
        ".package{font-weight:bold;font-size:15px}"
        "rect{fill:#eef3f8;stroke:#5b7a99}path{fill:none;stroke:#5b7a99;stroke-width:1.2;opacity:.6}"
        "@media(prefers-color-scheme:dark){text{fill:#dfe7ee}rect{fill:#24323f}}"
    )
    size = (
        f'width="{margin - 20:.0f}" height="{top + 40:.0f}"'
        f' viewBox="0 0 {margin - 20:.0f} {top + 40:.0f}"'
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{style}</style>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")

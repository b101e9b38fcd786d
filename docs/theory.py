"""Writes docs/theory.svg: the letters of the position and its coefficients.

`python docs/theory.py` runs it.
"""

import cmath
import math
from pathlib import Path

import fourbar

TARGET = Path(__file__).with_suffix(".svg")
LINKAGE, THETA_2 = (
    fourbar.uniform(100, 40, 120, 80),
    math.radians(40),
)  # Norton, example 4-1
LEFT, BASE, SCALE = 55.0, 235.0, 2.5
"""px: of O2 from the left and from above, of a unit of length."""


def screen(z: complex) -> str:
    """Place a point of the plane in the picture."""
    return f"{LEFT + SCALE * z.real:.1f} {BASE - SCALE * z.imag:.1f}"


def line(kind: str, *points: complex) -> str:
    """Draw a polyline."""
    return f'<path class="{kind}" d="M{" L".join(map(screen, points))}"/>'


def arc(
    centre: complex,
    radius: float,
    start: float,
    stop: float,
    kind: str = "arc",
) -> str:
    """Draw an arc from one angle to another, rad."""
    steps = [start + (stop - start) * i / 40 for i in range(41)]
    return line(kind, *(centre + cmath.rect(radius, angle) for angle in steps))


def label(z: complex, text: str) -> str:
    """Write a text at a point."""
    x, y = screen(z).split()
    return f'<text x="{x}" y="{y}">{text}</text>'


def text() -> str:
    """Draw the picture."""
    solution = fourbar.solve(
        fourbar.Scene(LINKAGE, fourbar.Motion(THETA_2)), "position"
    )
    O2, O4 = 0j, complex(LINKAGE.ground)
    A, B = (complex(*p[0]) for p in (solution.A, solution.B))
    theta_3, theta_4, delta = (
        float(solution.theta_3[0]),
        float(solution.theta_4[0]),
        cmath.phase(O4 - A),
    )
    ray = 32.0
    parts = [
        line("ground", O2, O4),
        line("bar", O2, A, B, O4),
        line("diagonal", A, O4),
        *(line("ray", z, z + ray) for z in (A, O4)),
        arc(O2, 18, 0, THETA_2),
        arc(A, 18, 0, theta_3),
        arc(O4, 18, 0, theta_4),
        arc(A, 27, 0, delta),
        arc(B, 14, theta_3 + math.pi, theta_4 + math.pi),
        *(
            f'<circle cx="{screen(z).split()[0]}" cy="{screen(z).split()[1]}" r="5"/>'
            for z in (O2, A, B, O4)
        ),
        label(O2 - 7 - 5j, "O₂"),
        label(A - 4 + 5j, "A"),
        label(B + 4 + 4j, "B"),
        label(O4 + 5 - 7j, "O₄"),
        label(O4 / 2 - 7j, "d"),
        label(A / 2 - 5 + 3j, "a"),
        label((A + B) / 2 - 3 + 6j, "b"),
        label((O4 + B) / 2 + 6 - 2j, "c"),
        label((A + O4) / 2 - 3 - 9j, "D, |D| = e"),
        label(cmath.rect(24, THETA_2 / 2), "ψ"),
        label(A + cmath.rect(24, theta_3 / 2), "θ₃"),
        label(O4 + cmath.rect(25, theta_4 / 2), "θ₄"),
        label(A + cmath.rect(31, delta / 2) - 1.5j, "δ"),
        label(B + cmath.rect(20, (theta_3 + theta_4) / 2 + math.pi), "μ"),
        (
            f'<text class="said" x="{LEFT:.0f}" y="{BASE + 55:.0f}">while θ₂ grows by'
            " dθ₂: δ by t dθ₂, μ by 2g dθ₂</text>"
        ),
    ]
    style = (
        "text{font:15px serif;font-style:italic;text-anchor:middle;fill:#1b2733}"
        ".said{text-anchor:start;font-style:normal}path{fill:none;stroke:#1b2733}.bar{stroke-width:4;stroke:#33658a}"
        ".ground{stroke-width:4;stroke:#99a3ad}"
        ".diagonal{stroke-width:2;stroke:#c1440e;stroke-dasharray:7 4}"
        ".ray{stroke-width:.8;stroke-dasharray:3 3}.arc{stroke-width:1.2}"
        "circle{fill:#fff;stroke:#1b2733;stroke-width:2}"
        "@media(prefers-color-scheme:dark){text{fill:#dfe7ee}path{stroke:#dfe7ee}"
        ".bar{stroke:#6fa8d6}.diagonal{stroke:#f08a4b}"
        "circle{fill:#24323f;stroke:#dfe7ee}}"
    )
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" width="480" height="320"'
        f' viewBox="0 0 480 320">\n<style>{style}</style>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")

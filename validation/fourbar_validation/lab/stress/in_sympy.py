"""The same linkage as one derives it in SymPy: closed angles, derivatives by `diff`, forces by Cramer's rule.

It shares nothing with the formulas but the numbers of the example.
"""

from typing import Any

import numpy as np

from fourbar.scene import Scene
from fourbar_validation.lab.stress.in_c import Array, Loop


def sympy_loop(scene: Scene) -> Loop | str:
    """The loop, or the reason why there is none; the scene has gravity alone, its drive on bar 2 and alpha_2 = 0."""
    try:
        import sympy
    except ImportError:
        return "SymPy is not installed: pip install sympy"
    q = sympy.Symbol("q", real=True)
    evaluate = sympy.lambdify(q, _unknowns(sympy, q, scene), "numpy", cse=True)

    def call(theta_2: Array, out: Array) -> None:
        for row, values in zip(out, evaluate(theta_2), strict=True):
            row[:] = values

    return call


def _unknowns(sympy: Any, q: Any, scene: Scene) -> list[Any]:
    d, a, b, c = scene.linkage.lengths
    speed, gravity = scene.motion.omega_2, sympy.Matrix([0, -np.hypot(*scene.effects[0].vector)])  # type: ignore[attr-defined]

    def along(angle: Any) -> Any:
        return sympy.Matrix([sympy.cos(angle), sympy.sin(angle)])

    def rate(x: Any) -> Any:
        return sympy.diff(x, q) * speed

    def cross(x: Any, y: Any) -> Any:
        return x[0] * y[1] - x[1] * y[0]

    A, O4 = a * along(q), sympy.Matrix([d, 0])
    to_O4 = O4 - A
    e = sympy.sqrt(to_O4.dot(to_O4))
    phi = sympy.atan2(to_O4[1], to_O4[0])
    theta_3 = phi + sympy.acos((e**2 + b**2 - c**2) / (2 * b * e))
    theta_4 = phi + sympy.pi - sympy.acos((e**2 + c**2 - b**2) / (2 * c * e))
    B = A + b * along(theta_3)
    bars = scene.linkage.input, scene.linkage.coupler, scene.linkage.output
    G2, G3, G4 = (start + 0.5 * end for start, end in ((0 * A, A), (A, B - A), (O4, B - O4)))
    pulls = [bar.mass * (rate(rate(G)) - gravity) for bar, G in zip(bars, (G2, G3, G4), strict=True)]
    omegas = [rate(theta) for theta in (theta_3, theta_4)]
    alphas = [rate(omega) for omega in omegas]
    # moments of the coupler about A and of the output about O4: (B - A) x F43 = p, (O4 - B) x F43 = r
    p = bars[1].moment_of_inertia * alphas[0] - cross(A - G3, pulls[1])
    r = bars[2].moment_of_inertia * alphas[1] - cross(O4 - G4, pulls[2])
    u, v = B - A, O4 - B
    F43 = (v * p - u * r) / cross(u, v)
    F32 = F43 - pulls[1]
    F14 = pulls[2] + F43
    F12 = pulls[0] - F32
    torque = -cross(-G2, F12) - cross(A - G2, F32)
    return [theta_3, theta_4, *omegas, *alphas, *F12, *F32, *F43, *F14, torque]

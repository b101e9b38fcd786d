"""A page of a user's code, which type checkers pass."""

import numpy as np

import fourbar

scene = fourbar.load("models/crank_rocker.toml")
solution = fourbar.solve(scene)
print(fourbar.solve(scene).torque.max())
energy = np.trapezoid(solution.torque, solution.theta_2)
table = solution.to_csv(degrees=True)

study = fourbar.vary(scene, {"lengths.input": np.linspace(0.09, 0.11, 5)})
peaks = np.abs(fourbar.solve(study).torque).max(axis=1)

positions = fourbar.solve(scene, "position")
path = positions.points["P"] if positions.points else positions.B
speeds = fourbar.solve(scene, "velocity").omega_4 / scene.motion.omega_2

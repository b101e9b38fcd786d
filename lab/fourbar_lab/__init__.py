"""Studies of the formulas, the harness and the engines: `python -m fourbar_lab`.

No verdict needs them.
"""

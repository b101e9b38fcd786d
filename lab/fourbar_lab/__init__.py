"""Studies of the formulas, the harness and the engines that no verdict needs: `python -m fourbar_lab`."""

"""Studies of the formulas, the harness and the engines: `python -m fourbar_lab`.

No verdict needs them.
"""

from pathlib import Path

LAB_FOLDER = Path(__file__).parent

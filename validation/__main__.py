"""`python -m validation`: the command line of the harness, in a checkout."""

import os
import sys
from pathlib import Path

HERE = str(Path(__file__).parent)
# where the checkout is not installed, and for the processes that are started from here
sys.path.insert(0, HERE)
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, (HERE, os.environ.get("PYTHONPATH")))
)

from fourbar_validation.cli import main  # noqa: E402

if __name__ == "__main__":
    main()

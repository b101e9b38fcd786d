"""`python -m fourbar_validation`: the command line of the harness.

The package may be installed anywhere.
"""

from fourbar_validation.cli import main

if __name__ == "__main__":
    main()

"""`python -m fourbar_validation`: the command line of the harness.

It works wherever the package is installed.
"""

from fourbar_validation.cli import main

if __name__ == "__main__":
    main()

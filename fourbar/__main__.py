"""`python -m fourbar` is the same as `fourbar`."""

from fourbar.cli import main

main()

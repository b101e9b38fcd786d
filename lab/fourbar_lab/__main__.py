"""`python -m fourbar_lab`: the commands of the lab."""

from fourbar_lab.cli import main

if __name__ == "__main__":
    main()

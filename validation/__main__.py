"""`python -m validation`: the command line of the harness."""

from validation.cli import main

if __name__ == "__main__":
    main()

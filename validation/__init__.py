"""The folder of the harness in a checkout: `python -m validation` starts it."""

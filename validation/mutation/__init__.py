"""The checks themselves are measured: how many small faults in the formulas the tests catch, and the harness alone."""

"""Printed figures of the thesis and of public test cases, and ours."""

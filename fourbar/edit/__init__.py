"""The workbench: a scene file changed in the browser.

The formulas answer each change in Python.
"""

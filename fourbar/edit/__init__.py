"""The workbench: a scene file changed in the browser, answered by the formulas in Python at each change."""

"""Stands in for the conftest.py of Genesis' own tests, so that the file beside it runs alone."""

import genesis as gs
import pytest


def pytest_configure(config):
    config.addinivalue_line("markers", "required: as in Genesis' own tests")
    config.addinivalue_line("markers", "precision: as in Genesis' own tests")


@pytest.fixture
def show_viewer():
    return False


@pytest.fixture(autouse=True)
def initialize(request, backend):
    gs.init(
        backend=backend,
        precision=request.node.get_closest_marker("precision").args[0],
        logging_level="error",
    )
    yield
    gs.destroy()

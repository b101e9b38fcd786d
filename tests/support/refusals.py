"""Refusals of what a person states."""

from contextlib import contextmanager

from pytest import raises

from fourbar import InputError


@contextmanager
def refused(*words):
    """What is done here is refused, in one line with these words."""
    with raises(InputError) as caught:
        yield
    said = str(caught.value)
    assert "\n" not in said
    for word in words:
        assert word in said, said

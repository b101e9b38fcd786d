"""A new scene file: the four lengths filled in, everything else explained in comments."""

from importlib.resources import files
from string import Template

from fourbar.files.fields import Reader
from fourbar.linkage import BAR_NAMES, POSITIVE, Bar, FourBar


def write_new_scene(lengths: tuple[str, ...] | list[str]) -> str:
    """Write a scene file for four lengths (ground, input, coupler, output), each with its unit, as it was given.

    Raises InputError for what is no length, and for bars that cannot close.
    """
    read = Reader("--lengths")
    given = [(name, " ".join(text.split())) for name, text in zip(BAR_NAMES.values(), lengths, strict=True)]
    d, a, b, c = (read.quantity(name, text, "m", POSITIVE) for name, text in given)
    FourBar(d, Bar(a), Bar(b), Bar(c))
    lines = "\n".join(f'{name} = "{text}"' for name, text in given)
    text = files("fourbar.files").joinpath("new.toml").read_text(encoding="utf-8")
    return Template(text).substitute(lengths=lines, input=repr(a), coupler=repr(b), output=repr(c))

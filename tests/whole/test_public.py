"""What is public is kept in public.txt.

`python -m tests.whole.test_public` writes it anew.
"""

import inspect
import pydoc
import runpy
from pathlib import Path

import click

import fourbar
import fourbar.cli
import fourbar_validation.cli
from fourbar import errors
from fourbar.quantities import QUANTITIES
from fourbar_validation import Answer
from fourbar_validation.compare.rows import RESULT_COLUMNS
from tests.support.checkout import ROOT
from tests.whole.test_docs import commands_of

KEPT = Path(__file__).with_name("public.txt")
GROUPS = {
    "fourbar": fourbar.cli.group,
    "fourbar-validation": fourbar_validation.cli.group,
}


def of_commands():
    for program, group in GROUPS.items():
        for name, command in commands_of(group).items():
            for option in sorted(command.params, key=lambda param: param.opts[0]):
                chosen = (
                    f" {'|'.join(option.type.choices)}"
                    if isinstance(option.type, click.Choice)
                    else ""
                )
                names = " ".join(sorted([*option.opts, *option.secondary_opts]))
                yield f"{program} {name}: {names}{chosen}"


def of_python():
    page = runpy.run_path(ROOT / "docs/api.py")
    public = {
        name: getattr(fourbar, name)
        for name in fourbar.__all__
        if name != "__version__"
    }
    functions = [name for name, thing in public.items() if not inspect.isclass(thing)]
    returned = page["results"](functions, list(public))
    for name, thing in {
        **public,
        **returned,
        "fourbar_validation.Answer": Answer,
    }.items():
        error = inspect.isclass(thing) and issubclass(thing, Exception)
        yield (
            f"{name}({thing.__base__.__name__})"
            if error
            else f"{name}{page['signature'](thing)}"
        )
        for method in page["METHODS"].get(name, ()):
            yield f"{name}.{method}{page['signature'](getattr(thing, method))}"


def public():
    """One line a name.

    Of Python, of commands and their options, exit statuses, quantities, columns of
    results.
    """
    yield from of_python()
    yield from of_commands()
    for name in ("HOLDS", "FAILED", "BAD_INPUT", "BROKEN"):
        yield f"exit status {name}: {getattr(errors, name)}"
    for q in QUANTITIES:
        yield f"quantity {q.name}: {q.unit}, {q.stage}, {q.kind}"
    yield f"columns of results: {', '.join(RESULT_COLUMNS)}"


def test_nothing_public_changes_unnoticed():
    kept = KEPT.read_text("utf-8").splitlines()
    assert kept == [*public()], "python -m tests.whole.test_public keeps it"


def test_all_is_what_dir_shows_and_help_explains():
    assert dir(fourbar) == fourbar.__all__
    for name in fourbar.__all__:
        assert name in pydoc.render_doc(getattr(fourbar, name))
    names = {}
    exec("from fourbar import *", names)
    assert set(fourbar.__all__) <= set(names)


if __name__ == "__main__":
    KEPT.write_text("\n".join([*public(), ""]), encoding="utf-8", newline="\n")

"""Types of the public names, as pyright sees them.

`python -m tests.support.public_types`. What is public is `fourbar.__all__`. The status
is 1 if a type of it, of its parameters or of its fields is unknown.
"""

import importlib.util
import json
import os
import sys
from pathlib import Path

import fourbar
from tests.support.checkout import ROOT, run_python

SKIPPED = "not checked: pyright is not installed: pip install 'pyright[nodejs]'"


def list_public():
    """List the public names by the modules that define them."""
    public = set()
    for name in fourbar.__all__:
        thing = getattr(fourbar, name)
        if hasattr(thing, "__qualname__"):
            public.add(f"{thing.__module__}.{thing.__qualname__}")
    return public


def list_unknown():
    """Yield a line for each public symbol whose type is unknown or only inferred."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    # pyright reads the libraries of the first Python on PATH: that is this one, also
    # where another environment is active
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    line = "-m pyright --outputjson --verifytypes fourbar --ignoreexternal"
    done = run_python(*line.split(), PYTHONPATH=path, PATH=programs)
    symbols = json.loads(done.stdout)["typeCompleteness"]["symbols"]
    public = list_public()
    named = {symbol["name"] for symbol in symbols}
    for name in sorted(public - named):
        yield f"{name}: pyright does not see it"
    for symbol in symbols:
        name = symbol["name"]
        of_public = name in public or name.rpartition(".")[0] in public
        if of_public and not (symbol["isTypeKnown"] and not symbol["isTypeAmbiguous"]):
            for found in symbol["diagnostics"] or [{"message": "unknown"}]:
                yield f"{name}: {' '.join(found['message'].split())}"


def main():
    """Print the symbols whose types are not known."""
    if importlib.util.find_spec("pyright") is None:
        print(f"public types: {SKIPPED}")
        return 0
    unknown = list(list_unknown())
    for line in unknown:
        print(line)
    print(f"public types: {len(list_public())} names, {len(unknown)} unknown types")
    return 1 if unknown else 0


if __name__ == "__main__":
    sys.exit(main())

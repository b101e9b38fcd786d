"""Parts K/N of one run, each judged in a folder of its own, and collected.

A part has many tasks; `run/store.py` keeps the file of each.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import click

from fourbar.errors import InputError
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.run.plan import Plan, Progress, show_progress
from fourbar_validation.run.request import (
    Request,
    keep_request,
    make_plan,
    read_request,
)
from fourbar_validation.run.run import open_store, write_outcome
from fourbar_validation.run.store import Store

_MOST_NAMED = 5
"""Parts that a message names; further ones are counted."""


def judge_part(plan: Plan, request: Request, progress: Progress) -> None:
    """Judge a part of a run into its folder.

    The folder keeps what an interrupted one left.
    """
    with open_store(plan, request.out) as store:
        keep_request(request, plan)
        plan.judge(store, progress)


def _gather(plan: Plan, folders: Sequence[Path], parts: int) -> dict[int, Store]:
    """Find the folder of each finished task of a run.

    InputError if a folder is of another run, if two copies of a task differ, or if
    tasks are missing or damaged, whose parts it names.
    """
    stores: dict[int, Store] = {}
    spoilt = []
    for folder in folders:
        store = Store(folder, plan.identity)
        store.require_same()
        for path, damage in store.examine():
            if damage:
                spoilt.append(f"{path} {damage}")
            else:
                task = int(path.name)
                first = stores.setdefault(task, store)
                if first is not store:
                    _require_alike(task, first, store)
    tasks = range(len(plan.tasks))
    missing = [task for task in tasks if task not in stores]
    if missing:
        numbers = sorted({task % parts + 1 for task in missing})
        named = [f"--part {number}/{parts}" for number in numbers]
        further = len(named) - _MOST_NAMED
        words = ", ".join(named[:_MOST_NAMED]) + f" and {further} more" * (further > 0)
        why = f"{len(missing)} of {len(tasks)} tasks are missing: run {words} again"
        raise InputError("DIR", "; ".join(spoilt[:_MOST_NAMED]) or None, why)
    return stores


def _require_alike(task: int, first: Store, second: Store) -> None:
    """Raise InputError unless two copies of a task have the same rows.

    Times and what engines printed may differ from machine to machine.
    """
    rows = [
        {json.dumps(row) for kept in store.read(task) for row in kept["rows"]}
        for store in (first, second)
    ]
    if differing := sorted(rows[0] ^ rows[1]):
        scene, engine, _, quantity, *_ = json.loads(differing[0])
        raise InputError(
            "DIR",
            str(second.folder),
            f"holds another result than {first.folder}: {quantity} of {engine} in"
            f" {scene}; name one of the two folders, or judge that part again",
        )


def collect_parts(
    plan: Plan,
    folders: Sequence[Path],
    parts: int,
    out: Path,
    progress: Progress,
) -> Summary:
    """Write tables and report of a run into `out` from its parts' folders.

    The folders stay as they are.
    """
    if any((out / "parts").glob("*")):
        why = "holds parts of a run: name it among the folders and choose another"
        raise InputError("--out", str(out), why)
    stores = _gather(plan, folders, parts)
    with open_store(plan, out) as store:
        summary = write_outcome(
            plan, lambda task: stores[task].read(task), out, progress
        )
        store.finish()
    return summary


@click.command(name="collect")
@click.argument(
    "folders",
    metavar="DIR...",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder for tables and report.",
)
@click.option("--verbose", is_flag=True, help="Print the worst row of each scene too.")
def collect_command(
    folders: tuple[Path, ...],
    out: Path,
    verbose: bool,
) -> int:
    """Put together the parts of a run.

    Tables and report are written from the folders in which `run --part` judged the
    parts. Parts of different runs are refused. If parts are missing, the command names
    them.
    """
    from fourbar_validation.report.terminal import print_table

    parts, request, files = read_request(folders[0])
    plan = make_plan(request, files)
    with show_progress(len(plan.suite)) as progress:
        summary = collect_parts(plan, folders, parts, out, progress)
    print_table(summary, out, verbose=verbose)
    return plan.conclude(summary)

"""Print a table of ratios, and write it as Markdown."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from fourbar.writing import write_text
from fourbar_validation.report.machine import describe_setup
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import render


def show_table(
    program: str,
    about: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    out: Path | None,
    remarks: Sequence[str] = (),
    devices: Iterable[str] = (),
) -> None:
    """Print a table and remarks, and write them into a file if there is one.

    Parameters
    ----------
    program : command of the lab that measured it.
    head : headings of the columns, that of the rows' names first.
    """
    from rich.console import Console

    Console().print(make_words_table(head, rows, caption=about))
    for line in remarks:
        click.echo(line)
    if out is None:
        return
    text = render(
        "fourbar_lab",
        "table.md.j2",
        program=program,
        about=about,
        head=["", *head[1:]],
        rows=rows,
        remarks=remarks,
        setup="; ".join((describe_setup(), *devices)),
    )
    write_text(out, text)
    click.echo(f"written to {out}")

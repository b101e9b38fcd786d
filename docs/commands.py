"""Writes docs/commands.md: the commands of `fourbar` and their options, as click has them. `python docs/commands.py`"""

from pathlib import Path

import click

from fourbar.cli import group

TARGET = Path(__file__).with_suffix(".md")
HEAD = """\
# The commands

After this page you know what each command prints and writes. `fourbar` alone prints its help, `-h` that of a command.

```console
$ fourbar classify 0.3 0.1 0.25 0.22 -o type.json
$ fourbar analyze models/crank_rocker.toml -o crank_rocker.csv
$ fourbar analyze models/crank_rocker.toml -o crank_rocker.json
$ fourbar plot models/crank_rocker.toml -o crank_rocker.svg --figure linkage
$ fourbar animate models/crank_rocker.toml -o crank_rocker.html
$ fourbar mjcf models/crank_rocker.toml -o crank_rocker.xml
$ fourbar mjcf --lengths 0.3 0.1 0.25 0.22 -o bare.xml
lengths in m: ground 0.3, input 0.1, coupler 0.25, output 0.22
bars: uniform and slender, 1 kg/m
branch: open
...
```
"""
TAIL = """\
## What analyze prints

It prints one block ([an example](tutorial.md#2-its-torque-and-pin-forces)). Positions are given by what is commanded:
an angle, a stroke or the time.

| motion | the block shows |
|---|---|
| positions only | ranges and transmission angle; no drive, pins or error bar |
| one position | values in place of peaks |
| a list of positions | peaks "of these positions", no energy |
| a sweep | energy per turn, or over the sweep; where the assembly ends |
| released | how long it moves and where it stops, in place of the drive |
| a cylinder drives | force, speed, stroke and the range over which it assembles; the bore with `--pressure` |
| dry friction at rest | the range of torque or force that holds |

Peaks of a sweep or a motion law are located between the positions. Towards a pole there is no largest value, and the
block says so.

The block and `classify` use imperial units where `lengths.ground` is in inches or feet, otherwise SI with prefixes.
`--units` takes `SI`, `imperial` or a list such as `"mm N N.mm deg rpm kW"`.

## JSON and CSV

Both hold SI units and radians with every digit. The CSV has one line per position with every
[quantity](results.md#the-quantities); the JSON adds the object `motor` with the numbers of the block. A missing value
is `null` or an empty cell, and `status` says why:

| status | meaning |
|---|---|
| `ok` | every quantity that was asked for is a number |
| `not_assembled` | the bars do not reach each other |
| `singular` | the velocities are 0/0 |
| `no_torque` | the two bars that are not driven lie in one line; no torque holds them |
| `no_lever` | the stroke of a linear drive stands still |
| `no_direction` | both ends of a spring lie in one point |
| `wound` | a torsion spring is half a turn or more from rest |
| `jammed`, `several` | no pin forces, or more than one set, fulfil the friction of the pin loads |
| `overflow` | a number is beyond the range of doubles |
| `invalid` | a member of a study has numbers that a scene refuses |

## Exit status

| status | meaning |
|---|---|
| 0 | all well; for `analyze` also when some positions do not assemble |
| 1 | a comparison fails, or nothing was compared |
| 2 | the input is bad; one line says what and where |
| 3 | the environment or the program failed |
| 130 | interrupted |

Files are written atomically. Shell completion: `eval "$(_FOURBAR_COMPLETE=bash_source fourbar)"` (`zsh_source`,
`fish_source` likewise).

*`python docs/commands.py` writes this page.*
"""


def list_rows(command: click.Command) -> list[str]:
    """Return the rows of a command's options."""
    return [describe(option) for option in command.params if isinstance(option, click.Option)]


def describe(option: click.Option) -> str:
    """Return an option's row: its names, what it takes, and its help."""
    choices = "|".join(option.type.choices) if isinstance(option.type, click.Choice) else ""
    names = ", ".join((*option.opts, *option.secondary_opts))
    takes = choices or option.metavar or ("" if option.is_flag else str(option.type.name).upper())
    words = " ".join((names, takes)).strip().replace("|", "\\|")
    return f"| `{words}` | {option.help} |"


def write_table(rows: list[str], last: str = "") -> str:
    """Write rows of options as a table, with a third column of this heading if there is one."""
    head = f"| option | meaning |{last and f' {last} |'}"
    return "\n".join((head, "|---|---|" + ("---|" if last else ""), *rows)) + "\n"


def text() -> str:
    """Return the page; a row that several commands share stands once, in front."""
    context = click.Context(group)
    commands = {name: group.get_command(context, name) for name in group.list_commands(context)}
    rows = {name: list_rows(command) for name, command in commands.items() if command is not None}
    users: dict[str, list[str]] = {}
    for name, command_rows in rows.items():
        for row in command_rows:
            users.setdefault(row, []).append(f"`{name}`")
    shared = {row: f"{row} {', '.join(names)} |" for row, names in users.items() if len(names) > 2}
    parts = [HEAD, "## Options of several commands\n", write_table([*shared.values()], "commands")]
    for name, command in commands.items():
        assert command is not None
        required = [
            f"{option.opts[0]} {option.metavar}"
            for option in command.params
            if isinstance(option, click.Option) and option.required
        ]
        usage = " ".join((*command.collect_usage_pieces(click.Context(command))[1:], *required))
        parts.append(f"## {name}\n\n`fourbar {name} {usage}`: {command.get_short_help_str(500)}\n")
        if special := [row for row in rows[name] if row not in shared]:
            parts.append(write_table(special))
    return "\n".join((*parts, TAIL))


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")

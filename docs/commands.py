"""Tables of the commands of `fourbar` and their options.

The site appends them to docs/commands.md.
"""

import click

from fourbar.cli import group


def list_rows(command: click.Command) -> list[str]:
    """Return the rows of a command's options."""
    return [
        describe(option)
        for option in command.params
        if isinstance(option, click.Option)
    ]


def describe(option: click.Option) -> str:
    """Return an option's row: its names, what it takes, and its help."""
    choices = (
        "|".join(option.type.choices) if isinstance(option.type, click.Choice) else ""
    )
    names = ", ".join((*option.opts, *option.secondary_opts))
    takes = (
        choices
        or option.metavar
        or ("" if option.is_flag else str(option.type.name).upper())
    )
    words = " ".join((names, takes)).strip().replace("|", "\\|")
    return f"| `{words}` | {option.help} |"


def write_table(rows: list[str], last: str = "") -> str:
    """Write rows of options as a table.

    A third column has this heading if there is one.
    """
    head = f"| option | meaning |{last and f' {last} |'}"
    return "\n".join((head, "|---|---|" + ("---|" if last else ""), *rows)) + "\n"


def text() -> str:
    """Return the tables; a row that several commands share stands once, in front."""
    context = click.Context(group)
    commands = {
        name: group.get_command(context, name) for name in group.list_commands(context)
    }
    rows = {
        name: list_rows(command)
        for name, command in commands.items()
        if command is not None
    }
    users: dict[str, list[str]] = {}
    for name, command_rows in rows.items():
        for row in command_rows:
            users.setdefault(row, []).append(f"`{name}`")
    shared = {
        row: f"{row} {', '.join(names)} |"
        for row, names in users.items()
        if len(names) > 2
    }
    parts = [
        "## Options of several commands\n",
        write_table([*shared.values()], "commands"),
    ]
    for name, command in commands.items():
        assert command is not None
        required = [
            f"{option.opts[0]} {option.metavar}"
            for option in command.params
            if isinstance(option, click.Option) and option.required
        ]
        usage = " ".join(
            (*command.collect_usage_pieces(click.Context(command))[1:], *required)
        )
        parts.append(
            f"## {name}\n\n`fourbar {name} {usage}`:"
            f" {command.get_short_help_str(500)}\n"
        )
        if special := [row for row in rows[name] if row not in shared]:
            parts.append(write_table(special))
    return "\n".join(parts)

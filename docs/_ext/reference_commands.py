"""Arguments and options of the commands of feeder-sim as Markdown, from the command line itself."""

from __future__ import annotations

from typing import Any

import typer

from feeder_sim.cli.main import app


def command_options(name: str) -> str:
    """What a command does, and a table of what it takes.

    Raises:
        KeyError: there is no such command.
    """
    command: Any = typer.main.get_command(app)
    command = command.commands[name]
    lines = [command.help, "", "| argument or option | default | meaning |", "|---|---|---|"]
    for parameter in command.params:
        if parameter.name == "help":
            continue
        written = parameter.name.upper() if parameter.param_type_name == "argument" else ""
        names = written or ", ".join(parameter.opts)
        shown = "required" if parameter.required else default(parameter)
        lines.append(f"| `{names}` | {shown} | {(parameter.help or '').replace('|', chr(92) + '|')} |")
    return "\n".join(lines)


def default(parameter: Any) -> str:
    value = parameter.default
    if value is None or value is False or value == [] or callable(value):
        return ""
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"

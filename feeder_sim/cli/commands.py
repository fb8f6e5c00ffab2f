"""The commands as a group: their names, and errors in how they are called, which are one line as all others."""

from __future__ import annotations

import functools
import gc
import importlib.util
import sys
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from feeder_sim.errors import InputError, Interrupted

# Of Click. Newer versions of typer have a Click of their own inside, so that its class has no other name in common.
_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]

GARBAGE = 50_000  # objects made, after which Python looks for garbage; 700 by itself

# Questions of many runs; their options are fields that take long to import.
STUDIES = {
    "sweep": "Run a scenario at many points; running the same again goes on with what is not done.",
    "uncertainty": "Run a scenario at many draws of its [uncertain] inputs; running the same again goes on.",
    "optimise": "Search for the recipe that makes a measure largest or smallest; running the same again goes on.",
    "chart": "Chart speed against accuracy of a measure: which setting to take; running the same again goes on.",
    "budget": "How far to trust a measure: numerics, seeds, inputs, and what the model leaves out.",
    "map": "Map the transport speed of a part over drive frequency and amplitude; running the same again goes on.",
}


class LateCommand(TyperCommand):
    """A command that is made when it is called."""

    @functools.cached_property
    def made(self) -> Any:
        from feeder_sim.cli.study import study_command

        return study_command(str(self.name), str(self.help))

    @property
    def params(self) -> list[Any]:
        return list(self.made.params)

    @params.setter
    def params(self, _: Any) -> None:
        pass  # those that it is begun with

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        return self.made.make_context(info_name, args, parent, **extra)


class Commands(TyperGroup):
    """The commands; `modes import` is one of two words beside `modes`, which takes a file there."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands.update((name, LateCommand(name, help=title)) for name, title in STUDIES.items())

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[:2] == ["modes", "import"]:
            args = ["modes import", *args[2:]]
        return super().resolve_command(ctx, args)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Options before the command; without any word Click's "error" is the help, which stays as it is."""
        has_args = bool(args)
        try:
            return super().make_context(info_name, args, parent, **extra)
        except _USAGE_ERROR as error:
            if not has_args:
                raise
            raise _in_one_line(error, None) from error

    def invoke(self, ctx: Any) -> Any:
        """Ctrl-C in any command is one line; typer would end without a word. So are wrong options."""
        start_quickly()
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Interrupted("interrupted") from None
        except _USAGE_ERROR as error:
            raise _in_one_line(error, ctx.invoked_subcommand) from error


def start_quickly() -> None:
    """Load what SciPy names and nobody uses when it is used, and do not look for garbage in what is being loaded."""
    gc.set_threshold(GARBAGE)
    for child in ("f2py", "testing"):
        spec = importlib.util.find_spec(f"numpy.{child}")
        if f"numpy.{child}" in sys.modules or spec is None or spec.loader is None:
            continue
        spec.loader = importlib.util.LazyLoader(spec.loader)
        module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
        setattr(sys.modules["numpy"], child, module)
        spec.loader.exec_module(module)


def _in_one_line(error: Any, command: str | None) -> InputError:
    """What Click prints below three lines on usage; in place of them the command that prints what is allowed."""
    problem = str(error.format_message()).rstrip(".")
    end = "" if problem.endswith("?") else "."
    return InputError(f"{problem}{end} See {' '.join(filter(None, ('feeder-sim', command)))} --help")

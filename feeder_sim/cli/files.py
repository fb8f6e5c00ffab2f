"""Files named on the command line: reading them, and checks that refuse them before any work is done."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from feeder_sim.errors import InputError, option_of
from feeder_sim.example_files import examples, scenario_path

if TYPE_CHECKING:
    from feeder_sim.plate.mode_file import ModeFile
    from feeder_sim.scenario import Scenario


# Options and arguments that several commands have, with the same name and the same meaning.

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
EngineName = Annotated[str | None, typer.Option("--engine", help="Engine instead of the scenario's.")]
Seeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Number of seeds instead of the scenario's.")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Root of the random numbers.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", help="KEY=VALUE in place of the scenario's, such as 'drive[0].amplitude_um=2'; repeatable."),
]
Measure = Annotated[str | None, typer.Option("--measure", help="Measure to print and draw [the usual one].")]
WorkerCount = Annotated[int | None, typer.Option("--workers", min=1, help="Processes [one per core].")]
ThreadCount = Annotated[int | None, typer.Option("--workers", min=1, help="Threads [one per core].")]
StallAfter = Annotated[
    float | None, typer.Option("--stall-after", help="Wall time in s after which a seed without a new frame ends [60].")
]
Dask = Annotated[str | None, typer.Option("--dask", help="Scheduler of a Dask cluster, such as tcp://host:8786.")]


PICTURES = (".png", ".svg", ".pdf", ".jpg")


def complete_scenario(incomplete: str) -> list[str]:
    """What a shell can offer for a scenario: examples by their names, TOML files, and folders on the way to them."""
    matches = [name for name in examples() if name.startswith(incomplete)]
    with contextlib.suppress(OSError):
        folder = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
        for path in sorted(folder.glob("*")):
            if str(path).startswith(incomplete) and (path.suffix == ".toml" or path.is_dir()):
                matches.append(f"{path}/" if path.is_dir() else str(path))
    return matches


_SCENARIO: Any = typer.Argument(
    help="Scenario file (TOML), or the name of an example.", show_default=False, autocompletion=complete_scenario
)
ScenarioFile = Annotated[Path, _SCENARIO]


def scenario_of(
    path: Path, engine: str | None, seeds: int | None, seed: int | None, settings: list[str] | None = None
) -> Scenario:
    """Load a scenario file, or an example by its name; put the options that are given into it: its [run], and `--set`.

    Raises:
        InputError: a file that cannot be used, or a value that is not allowed.
    """
    from feeder_sim.scenario import load_scenario, with_run
    from feeder_sim.scenario.changes import read_changes

    path = scenario_path(path)
    scenario = load_scenario(path)
    if settings:
        scenario = scenario.changed(read_changes(settings), file=path)
    options = {"engine": engine, "seeds": seeds, "seed": seed}
    return with_run(scenario, file=path, **{name: value for name, value in options.items() if value is not None})


def modes_of(source: Path) -> ModeFile:
    """Read a mode file, or compute the modes of a plate file or of the plate that a scenario describes (.toml).

    Raises:
        InputError: a file that cannot be used.
    """
    if source.suffix == ".toml":
        from feeder_sim.scenario import BendingPlate, Excitation, excitations_of, load_plate_file
        from feeder_sim.scene.plate_modes import compute_modes

        with file_in_errors(source):
            scenario = scenario_of_plate(source)
            if scenario is None:
                return compute_modes(load_plate_file(source))
            from feeder_sim.scene.driven_plate import modes_of as modes_of_described

            assert isinstance(scenario.plate, BendingPlate)  # its own check
            return modes_of_described(scenario.plate, excitations_of(scenario, Excitation))
    from feeder_sim.plate.mode_file import read_mode_file

    return read_mode_file(source)


def scenario_of_plate(source: Path) -> Scenario | None:
    """The scenario in a file that describes its plate; None of a plate file.

    Raises:
        InputError: a scenario with another kind of plate.
    """
    import tomllib

    from feeder_sim.scenario import BendingPlate, load_scenario
    from feeder_sim.scenario.tables import read_text

    try:
        if "part" not in tomllib.loads(read_text(source)):
            return None
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        return None  # as the reader of plate files says
    scenario = load_scenario(source)
    if not isinstance(scenario.plate, BendingPlate):
        raise InputError(
            f'is "{scenario.plate.kind}", must be "plate" in a scenario; else its mode file or a plate file',
            file=source,
            key="plate.kind",
        )
    return scenario


def new_picture(path: Path) -> Path:
    """Refuse a path to which no picture can be drawn; return the path.

    Raises:
        InputError: the file exists, its folder does not, or its suffix is not in `PICTURES`.
    """
    writable(path)
    if path.suffix.lower() not in PICTURES:
        raise InputError(f"is {path.suffix!r}, must be {', '.join(PICTURES)}", file=path, key="--picture")
    return path


def writable(path: Path, *, force: bool | None = None) -> Path:
    """Refuse a path to which no file can be written; return the path.

    Args:
        path: of the file.
        force: whether it may exist; None for a command that never replaces a file.

    Raises:
        InputError: the file exists, unless `force` is set, or its folder does not.
    """
    if path.exists() and not force:
        other = "must be a new file" if force is None else "--force replaces it"
        raise InputError(f"exists already, {other}", file=path)
    if not path.parent.is_dir() or path.is_dir():
        raise InputError("must be a file in a folder that exists", file=path)
    return path


@contextlib.contextmanager
def options_in_errors() -> Iterator[None]:
    """Let each InputError in the block name an option, such as --until-se, where it names an argument, until_se."""
    try:
        yield
    except InputError as error:
        if error.argument is None:
            raise
        options = ", ".join(map(option_of, error.argument.split(", ")))
        key = options if error.key is None else f"{options} {error.key}"
        raise InputError(error.problem, file=error.file, key=key) from error


@contextlib.contextmanager
def file_in_errors(file: Path) -> Iterator[None]:
    """Add the name of a file to each InputError that is raised without one in the block; `options_in_errors`, too."""
    try:
        with options_in_errors():
            yield
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(error.problem, file=file, key=error.key) from error

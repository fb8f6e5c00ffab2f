"""Scenario files: TOML -> frozen, validated values. The names of keys contain their units.

A scenario consists of a plate, its drives or a schedule of drives, the parts, their contact, and how to run it:

    Scenario(plate=Strip(thickness_mm=3), drive=[Drive(frequency_hz=4750, amplitude_um=1)], part=[HexNut(size="M2.5")],
             run=Run(duration_s=1))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from feeder_sim.errors import InputError, check_type, path_of_user
from feeder_sim.example_files import scenario_path
from feeder_sim.scenario.changes import changed_values, check_variable
from feeder_sim.scenario.drawn_tables import with_drawn_tables
from feeder_sim.scenario.fixture import MAX_FIXTURES, Fixture
from feeder_sim.scenario.outlet import MAX_OUTLETS, Outlet
from feeder_sim.scenario.part import Heap, Scattered, Slide, Tube
from feeder_sim.scenario.plate import (
    MOST_DRIVES,
    ActuatorFile,
    AnyDrive,
    Excitation,
    ModePlate,
    Oscillation,
    OutlineFile,
    Plate,
    PlateFile,
    TrayExcitation,
)
from feeder_sim.scenario.rules import findings_of_level
from feeder_sim.scenario.run import Contact, MujocoSettings, Run
from feeder_sim.scenario.schedule import Goal, Pick, Refill, Robot, Schedule, Stage
from feeder_sim.scenario.shapes import PartSpec
from feeder_sim.scenario.shown import html_of, line_of
from feeder_sim.scenario.tables import Table, folder_of, parse, read_text, validated
from feeder_sim.scenario.uncertain import Uncertain, with_draws

# The files that a scenario reads: which they are, and the same scenario with other names for them.

MOTION_FILES = ("motion_file", "psd_file")  # of a drive of a tray
Change = Callable[[Path], Path]
# Of contacts without a step, where the scenario does not say: of one part and on trays, and of several elsewhere.
TOLERANCE_NM, TOLERANCE_OF_SEVERAL_NM = 0.1, 10.0


Driven = TypeVar("Driven", bound=Oscillation)


def excitations_of(scenario: Scenario, kind: type[Driven]) -> tuple[tuple[str, Driven], ...]:
    """The excitations of a kind, with their keys; rules allow none but those that move the plate of the scenario."""
    return tuple((key, drive) for key, drive in scenario.excitations if isinstance(drive, kind))


def input_files(scenario: Scenario) -> dict[str, Path]:
    """The files that a scenario reads, by its keys: of the plate, its motion, parts, their pieces and grippers."""
    files: dict[str, Path] = {}
    if isinstance(scenario.plate, ModePlate):
        files["plate.mode_file"] = scenario.plate.mode_file
    motions = excitations_of(scenario, TrayExcitation)
    for name in MOTION_FILES:
        files |= {f"{key}.{name}": file for key, drive in motions if (file := getattr(drive, name))}
    for i, part in enumerate(scenario.part):
        files |= {f"part[{i}].{key}": file for key, file in part.files.items()}
    for i, fixture in enumerate(scenario.fixtures):
        files |= {f"fixture[{i}].{key}": file for key, file in fixture.files.items()}
    picks = scenario.schedule.picks if scenario.schedule else ()
    return files | {f"{key}.shape": pick.shape for key, pick in picks if pick.shape is not None}


def with_files(scenario: Scenario, change: Change) -> Scenario:
    """The scenario with another name for each of its files; pieces that lie beside their mesh are named, too."""
    plate, schedule = scenario.plate, scenario.schedule
    if isinstance(plate, ModePlate):
        plate = plate.model_copy(update={"mode_file": change(plate.mode_file)})
    parts, fixtures = (
        tuple(table.model_copy(update={k: change(file) for k, file in table.files.items()}) for table in tables)
        for tables in (scenario.part, scenario.fixtures)
    )
    if schedule is not None:
        groups = {
            group: tuple(_stage_with(stage, change) for stage in getattr(schedule, group))
            for group in ("prepare", "stage")
        }
        schedule = schedule.model_copy(update=groups)
    drives = _drives_with(scenario.drive, change)
    return scenario.model_copy(
        update={"plate": plate, "drive": drives, "part": parts, "fixture": fixtures or None, "schedule": schedule}
    )


def _drives_with(drives: tuple[Driven, ...], change: Change) -> tuple[Driven, ...]:
    """The drives with other names for their tables of motion."""
    return tuple(
        drive.model_copy(update={name: change(file) for name in MOTION_FILES if (file := getattr(drive, name, None))})
        for drive in drives
    )


def _stage_with(stage: Stage, change: Change) -> Stage:
    """The stage with other names for the motions of its drives and the shapes of its grippers."""
    stage = stage.model_copy(update={"drive": _drives_with(stage.drive, change)})
    if isinstance(stage.pick, Pick):
        return stage.model_copy(update={"pick": _pick_with(stage.pick, change)})
    return stage.model_copy(update={"pick": tuple(_pick_with(pick, change) for pick in stage.picks) or None})


def _pick_with(pick: Pick, change: Change) -> Pick:
    return pick if pick.shape is None else pick.model_copy(update={"shape": change(pick.shape)})


STILL_HZ = 250.0


class Scenario(Table):
    """One experiment on one plate."""

    title: str = ""
    format: Literal[1] = 1
    plate: Plate
    drive: Annotated[tuple[AnyDrive, ...], Field(max_length=MOST_DRIVES)] = ()
    schedule: Schedule | None = None
    part: Annotated[tuple[PartSpec, ...], Field(min_length=1, max_length=100)]
    fixture: Annotated[tuple[Fixture, ...], Field(min_length=1, max_length=MAX_FIXTURES)] | None = None
    outlet: Annotated[tuple[Outlet, ...], Field(min_length=1, max_length=MAX_OUTLETS)] | None = None
    drawing_account: str | None = None
    contact: Contact = Contact()
    mujoco: MujocoSettings = MujocoSettings()
    goal: Goal | None = None
    refill: Refill | None = None
    robot: Robot | None = None
    uncertain: (
        Annotated[dict[str, Uncertain], Field(min_length=1, max_length=100), BeforeValidator(with_draws)] | None
    ) = None
    run: Run

    def __repr__(self) -> str:
        return line_of(self)

    def _repr_html_(self) -> str:
        return html_of(self)

    @property
    def tolerance(self) -> float:
        """How far contacts without a step may be off [nm]; along a tray it makes the speed."""
        several = self.n_parts > 1 or self.refill is not None
        usual = TOLERANCE_OF_SEVERAL_NM if several and self.plate.kind != "tray" else TOLERANCE_NM
        return usual if self.run.tolerance_nm is None else self.run.tolerance_nm

    @property
    def n_parts(self) -> int:
        """Number of parts of all tables together."""
        return sum(part.count for part in self.part)

    @property
    def rim_of_fixtures(self) -> bool:
        """Whether a rim is made of fixtures: around a tray, with which they move, or an outline."""
        plate = self.plate
        return bool(getattr(plate, "rim", False)) and (
            plate.kind == "tray" or getattr(plate, "outline", None) is not None
        )

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """What stands on the plate."""
        return self.fixture or ()

    @property
    def outlets(self) -> tuple[Outlet, ...]:
        """Where parts leave."""
        return self.outlet or ()

    @property
    def kind_names(self) -> tuple[str, ...]:
        """What the kinds of parts are called: their names, else their shapes, numbered as the tables where needed."""
        shapes = [part.shape for part in self.part]
        return tuple(
            part.name or (part.shape if shapes.count(part.shape) == 1 else f"{part.shape}_{i}")
            for i, part in enumerate(self.part)
        )

    @property
    def parts_at_once(self) -> int:
        """How many parts are on the plate at the start, and at most after a refill."""
        return (self.refill.to if self.refill else None) or self.n_parts

    @property
    def refill_start(self) -> Scattered | Heap | None:
        """Where new parts start; None without a refill."""
        if self.refill is None:
            return None
        start = self.refill.start or self.part[0].start
        return start if isinstance(start, Scattered | Heap) else None

    @property
    def guide(self) -> Slide | Tube | None:
        """The guide of the first part. A part in a guide is the only one of its scenario."""
        return self.part[0].guide

    @property
    def excitations(self) -> tuple[tuple[str, Excitation | TrayExcitation], ...]:
        """Every excitation once, with its key in the file: the drives, or those of all stages of the schedule."""
        if self.schedule is None:
            return tuple((f"drive[{i}]", drive) for i, drive in enumerate(self.drive))
        return tuple(
            (f"schedule.{group}[{i}].drive[{j}]", drive)
            for group in ("prepare", "stage")
            for i, stage in enumerate(getattr(self.schedule, group))
            for j, drive in enumerate(stage.drive)
        )

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the plate's motion; a plate that rings moves at the natural frequency of the mode.

        A plate that stands still has the steps of one at `STILL_HZ`.
        """
        if self.plate.kind == "still":
            return STILL_HZ
        return max(max(d.frequency_hz, d.natural_frequency_hz or 0.0) for _, d in self.excitations)

    def changed(self, changes: Mapping[str, Any], *, file: Path = Path("scenario")) -> Scenario:
        """The scenario with other values, checked as those of a file are.

        Args:
            changes: values by their keys, such as `{"drive[0].amplitude_um": 2.0}`; None takes a value out. Relative
                paths start from the current folder.
            file: names the scenario in messages.

        Raises:
            InputError: a key that does not exist, or a value that is not allowed.
        """
        check_type(changes, Mapping, "a dictionary of values by key", "changed")
        raw = changed_values(self.model_dump(), changes, file)
        return _anchor_paths(validated(raw, Scenario, file), Path.cwd())

    @model_validator(mode="before")
    @classmethod
    def _from_drawings(cls, data: Any, info: ValidationInfo) -> Any:
        """Put fixtures and outlets of drawings in."""
        return with_drawn_tables(data, folder_of(info))

    @model_validator(mode="after")
    def _keeps_the_rules(self) -> Self:
        for problem in findings_of_level(self, "refused"):
            raise ValueError(problem)
        if not self.run.allow_unstable:
            for problem in findings_of_level(self, "unstable"):
                raise ValueError(f"{problem}; run.allow_unstable = true runs it all the same")
        return self

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        names = self.kind_names
        for i, name in enumerate(names):
            if name in names[:i]:
                number = i if self.part[i].name else names.index(name)
                raise ValueError(f'part[{number}].name is "{name}", must be a name of its own')
        outlets = [outlet.name for outlet in self.outlets]
        for i, name in enumerate(outlets):
            if name in outlets[:i]:
                raise ValueError(f'outlet[{i}].name is "{name}", must be a name of its own')
        return self

    @model_validator(mode="after")
    def _picks_of_kinds(self) -> Self:
        names = self.kind_names
        kinds = ", ".join(names)
        picks: list[tuple[str, Pick | Outlet]] = [*(self.schedule.picks if self.schedule else ())]
        picks += [(f"outlet[{i}]", outlet) for i, outlet in enumerate(self.outlets)]
        for key, pick in picks:
            if pick.part is not None and pick.part not in names:
                raise ValueError(f'{key}.part is "{pick.part}", must be {kinds}')
            if pick.up and pick.part is None and len(names) > 1:
                raise ValueError(f"{key}.up needs the kind whose poses are meant, part: {kinds}")
        return self

    @model_validator(mode="after")
    def _uncertain_values_are_allowed(self) -> Self:
        varied: set[str] = set()
        for key, uncertain in (self.uncertain or {}).items():
            keys = (key, *uncertain.also)
            for name in keys:
                _check_variable(name)
                if name in varied:
                    raise ValueError(f"uncertain holds {name} twice, must be each key once")
                varied.add(name)
            for value in uncertain.extremes:
                self._check_changed(dict.fromkeys(keys, value), key)
        if len({len(u.joint) for u in (self.uncertain or {}).values() if u.joint}) > 1:
            raise ValueError("uncertain has joint values of different numbers, must be as many of each")
        return self

    def _check_changed(self, changes: dict[str, Any], key: str) -> None:
        """Refuse values of an uncertain input that a file could not have."""
        raw = self.model_dump(exclude={"uncertain"})
        try:
            Scenario.model_validate(changed_values(raw, changes, Path("scenario")))
        except ValidationError as error:
            first, value = error.errors()[0], changes[key]
            message = "there is no such key" if first["type"] == "extra_forbidden" else first["msg"]
            message = message.removeprefix("Value error, ").replace("Input should be", "must be")
            value_text = f"{value:.6g}" if isinstance(value, float) else repr(value)
            raise ValueError(f"uncertain.{key} may be {value_text}: {message}") from None
        except InputError as error:
            raise ValueError(f"uncertain.{key}: {error.key}: {error.problem}") from None


def _check_variable(key: str) -> None:
    """Refuse a key that decides nothing, for a validator."""
    try:
        check_variable(key)
    except InputError as error:
        raise ValueError(f"uncertain.{error.key}: {error.problem}") from None


def check_scenario(value: object) -> None:
    """Refuse what is no scenario, as where a user of Python gives its file.

    Raises:
        InputError: as said.
    """
    check_type(value, Scenario, "a Scenario, such as load_scenario gives", "scenario")


def load_scenario(path: str | Path) -> Scenario:
    """Read and check a scenario file, or an example by its name; paths in a file are relative to it.

    Args:
        path: of the file, or as `feeder-sim list` names an example, such as "drift_4750hz". A file of that name is
            taken first.

    Raises:
        InputError: unreadable file, TOML syntax, or any key or value that is not allowed.
    """
    path = scenario_path(path_of_user(path, "load_scenario"))
    return parse_scenario(read_text(path), file=path)


def parse_scenario(text: str, *, file: Path) -> Scenario:
    """Check the text of a scenario; `file` names it in messages, and relative paths start from its folder.

    Raises:
        InputError: TOML syntax, or any key or value that is not allowed.
    """
    return _anchor_paths(parse(text, Scenario, file), file.resolve().parent)


def with_run(scenario: Scenario, *, file: Path = Path("scenario"), **changes: Any) -> Scenario:
    """The scenario with other values in its [run] table, which are checked; `file` names it in messages.

    Raises:
        InputError: a value that is not allowed.
    """
    return validated(scenario.model_dump() | {"run": scenario.run.model_dump() | changes}, Scenario, file)


def load_plate_file(path: Path) -> PlateFile:
    """Read and check a plate file; errors as for `load_scenario`."""
    return parse(read_text(path), PlateFile, path)


def load_actuator_file(path: Path) -> ActuatorFile:
    """Read and check a file of actuators; errors as for `load_scenario`."""
    return parse(read_text(path), ActuatorFile, path)


def load_outline_file(path: Path) -> OutlineFile:
    """Read and check an outline file; errors as for `load_scenario`."""
    return parse(read_text(path), OutlineFile, path)


def _anchor_paths(scenario: Scenario, folder: Path) -> Scenario:
    """Make the file names in a scenario absolute."""
    return with_files(scenario, lambda path: folder / path)

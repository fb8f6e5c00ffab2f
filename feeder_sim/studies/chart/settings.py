"""The settings that a chart compares: methods from coarse to fine, and simplifications one by one.

    no-step      impulses without a step, to a tolerance
    steps        impulses in steps, so many per period
    mujoco       MuJoCo, so many steps per period; a hundred times as dear, so it has to be asked for
    simplified   the scenario as it is, with one effect left out, or one more taken in

A setting only changes keys of the scenario, so that a scenario file can ask for whatever a chart recommends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import choose_engine

NO_STEP, STEPS, MUJOCO, SIMPLIFIED = "no-step", "steps", "mujoco", "simplified"
METHODS = (NO_STEP, STEPS, MUJOCO, SIMPLIFIED)
TOLERANCES_NM = (10.0, 1.0, 0.1, 0.01)
STEPS_PER_PERIOD = (20, 40, 80, 160, 320)
MUJOCO_STEPS = (20, 40, 80)


@dataclass(frozen=True)
class Setting:
    """One way to compute a scenario.

    Attributes:
        method: one of `METHODS`; "" for the scenario as it is, where that is none of them.
        name: of the setting, in words.
        changes: of the scenario, by key; None takes a value out.
    """

    method: str
    name: str
    changes: Mapping[str, Any]


def settings_of(scenario: Scenario, methods: tuple[str, ...], file: Path) -> tuple[list[Setting], list[str]]:
    """The settings of some methods that a scenario can be computed with; why the others are left out, a line each."""
    settings: list[Setting] = []
    left_out: dict[str, str] = {}
    for setting in _settings(scenario):
        if setting.method not in methods:
            continue
        try:
            varied = scenario.changed({"uncertain": None, **setting.changes}, file=file)
            if setting.method in (NO_STEP, STEPS) and choose_engine(varied).method == "slide":
                continue  # its events are exact whatever the tolerance or the step
            prepare(varied)
        except InputError as error:
            key = setting.name if setting.method == SIMPLIFIED else setting.method
            left_out.setdefault(key, f"{key}: {error.problem}")
            continue
        settings.append(setting)
    if not any(is_default(scenario, setting, file) for setting in settings):
        settings.append(Setting("", "as it is", {}))
    return settings, list(left_out.values())


def reference_of(settings: Sequence[Setting]) -> tuple[int, int | None]:
    """Which setting is the reference: the finest of the most exact method; and the next finer one, which checks it."""
    for method in (NO_STEP, STEPS, MUJOCO):
        if of_method := [i for i, setting in enumerate(settings) if setting.method == method]:
            return of_method[-1], of_method[-2] if len(of_method) > 1 else None
    return len(settings) - 1, None


def is_default(scenario: Scenario, setting: Setting, file: Path) -> bool:
    """Whether a setting is what the scenario itself asks for."""
    if setting.method == SIMPLIFIED:
        return False
    varied = scenario.changed(setting.changes, file=file)
    return _resolved(varied) == _resolved(scenario)


def _resolved(scenario: Scenario) -> tuple[Any, ...]:
    method = choose_engine(scenario).method
    return method, scenario.tolerance if method in ("exact", "joint") else scenario.run.steps


def _settings(scenario: Scenario) -> Iterator[Setting]:
    """All of them, from coarse to fine."""
    for tolerance in TOLERANCES_NM:
        changes = {"run.engine": "impulse", "run.tolerance_nm": tolerance, "run.steps_per_period": None}
        yield Setting(NO_STEP, f"no step, {tolerance:g} nm", changes)
    for method, engine, numbers in ((STEPS, "impulse", STEPS_PER_PERIOD), (MUJOCO, "mujoco", MUJOCO_STEPS)):
        for number in numbers:
            changes = {"run.engine": engine, "run.tolerance_nm": None, "run.steps_per_period": number}
            yield Setting(method, f"{'MuJoCo, ' if engine == 'mujoco' else ''}{number} steps", changes)
    for name, key, plain in (
        ("tangent plane", "tangent_surface", False),
        ("planar", "planar", False),
        ("no in-plane velocity", "in_plane_velocity", True),
        ("plate that gives way", "reaction", False),
    ):
        if getattr(scenario.run, key) == plain:
            yield Setting(SIMPLIFIED, name, {f"run.{key}": not plain})
    if scenario.drive and all(drive.ring_up for drive in scenario.drive):
        yield Setting(SIMPLIFIED, "no ring-up", {f"drive[{i}].ring_up": False for i in range(len(scenario.drive))})

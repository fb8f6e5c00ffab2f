"""Scenes shared by the tests, built in code."""

from __future__ import annotations

import functools
import itertools
import os
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: small matrices take five times as long with two

import numpy as np
import pytest
import tomli_w
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.parts_engine import COLUMNS
from feeder_sim.errors import InputError
from feeder_sim.machine_code.jit import callable_from_python
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.scenario import Contact, Drive, HexNut, RigidPlate, Run, Scenario, Start, Strip
from feeder_sim.scenario.changes import changed_values
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene

REPOSITORY = Path(__file__).parents[1]
NUT_ON_STRIP: dict[str, Any] = {
    "plate": {"kind": "strip", "thickness_mm": 3.0},
    "drive": [{"frequency_hz": 4750.0, "amplitude_um": 1.0}],
    "part": [{"shape": "hex_nut", "size": "M2.5"}],
    "run": {"duration_s": 1.0},
}
BALL_ON_SLIDE: dict[str, Any] = {  # which is simulated in no time
    "plate": {"kind": "piston"},
    "drive": [{"frequency_hz": 50.0, "amplitude_um": 150.0}],
    "part": [{"shape": "ball", "diameter_mm": 3.0, "guide": {"kind": "slide"}}],
    "run": {"duration_s": 0.5, "seeds": 2},
}


def pytest_configure(config: pytest.Config) -> None:
    for subject, table in subjects().items():
        config.addinivalue_line("markers", f"{subject}: {table['about']}; see tests/subjects.toml")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark quick tests by their subject; those that take minutes come first, not to keep a single core at work last."""
    of_file = {
        REPOSITORY / "tests" / folder / f"test_{name}.py": subject
        for subject, table in subjects().items()
        for folder, names in table.items()
        if folder != "about"
        for name in names
    }
    for item in items:
        if item.path in of_file and item.get_closest_marker("slow") is None:
            item.add_marker(of_file[item.path])
    items.sort(key=lambda item: not any(mark.kwargs.get("minutes") for mark in item.iter_markers("slow")))


@functools.cache
def subjects() -> dict[str, dict[str, Any]]:
    return tomllib.loads((REPOSITORY / "tests/subjects.toml").read_text(encoding="utf-8"))


@pytest.fixture
def repository() -> Path:
    return REPOSITORY


def toml_of(document: Mapping[str, Any], changes: Mapping[str, Any] | None = None) -> str:
    """A document as a file has it, with other values at dotted keys; None takes a value out."""
    return tomli_w.dumps(_without_none(changed_values(document, changes or {}, Path("document"))))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_none(entry) for key, entry in value.items() if entry is not None}
    return [_without_none(entry) for entry in value] if isinstance(value, list | tuple) else value


def refusal(call: Callable[..., object], *arguments: Any, **named: Any) -> str:
    """The one line with which a call is refused as bad input."""
    with pytest.raises(InputError) as refused:
        call(*arguments, **named)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def amplitude_of(scenario: Scenario) -> float:
    """Of the first drive [um]; 0 of a voltage."""
    drive = scenario.drive[0]
    assert isinstance(drive, Drive)
    return drive.amplitude_um or 0.0


def strip_scenario(
    *, frequency_hz: float = 4750.0, amplitude_um: float = 1.0, x_mm: float = 1.95, **run: Any
) -> Scenario:
    """An M2.5 nut near the antinode of a standing wave."""
    return Scenario(
        plate=Strip(thickness_mm=3.0),
        drive=(Drive(frequency_hz=frequency_hz, amplitude_um=amplitude_um),),
        part=(HexNut(size="M2.5", start=Start(position_mm=(x_mm, 0.0))),),
        run=Run(**({"duration_s": 0.05, "seeds": 1} | run)),
    )


def piston_scenario(
    *,
    frequency_hz: float = 4750.0,
    amplitude_um: float = 0.0,
    start: Start | None = None,
    part: Any = None,
    plate: Mapping[str, Any] | None = None,
    drive: tuple[Drive, ...] = (),
    contact: Contact | None = None,
    **run: Any,
) -> Scenario:
    """A part or several over a plate that moves as a whole; at rest by default."""
    part = part or HexNut(size="M2.5", start=start or Start())
    return Scenario(
        plate=RigidPlate(kind="piston", **(plate or {})),
        drive=drive or (Drive(frequency_hz=frequency_hz, amplitude_um=amplitude_um),),
        part=part if isinstance(part, tuple) else (part,),
        contact=contact or Contact(),
        run=Run(**({"duration_s": 0.05, "seeds": 1} | run)),
    )


def ready(scene: Scene) -> Prepared:
    """A scene as it stands, perhaps changed by a test, with the engine of its scenario."""
    return Prepared(scene, choose_engine(scene.scenario), transport_cell(scene), ())


def ball_on_slide(**run: Any) -> Scenario:
    return Scenario.model_validate(BALL_ON_SLIDE).changed({f"run.{key}": value for key, value in run.items()})


@functools.cache
def from_python(function: Any) -> Any:
    """A function that is compiled for other compiled ones, to be called by a test."""
    return callable_from_python(function.py_func)


def symmetric(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    """A symmetric matrix (3, 3) as compiled code takes it."""
    return tuple(float(matrix[i, j]) for i in range(3) for j in range(i, 3))


def struck(
    mass: float,
    inverse_inertia: NDArray[np.float64],
    motion: tuple[NDArray[np.float64], NDArray[np.float64]],
    touch: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    law: tuple[float, float],
    modes: Any = None,
) -> None:
    """Impact of one body on a surface at n points at once; changes its motion, velocity and angular momentum, in place.

    touch: arms, normals and velocities of the surface, (n, 3) each; law: restitution and friction.
    """
    from feeder_sim.engines.impulse import contact_problem

    arm, normal, surface = touch
    n, (velocity, momentum) = len(arm), motion
    bodies, contacts = contact_problem.new_room(1, n, 0 if modes is None else len(modes.velocity_loss))
    contacts = contacts._replace(modes=modes or contacts.modes)
    bodies.velocity[0], bodies.spin[0], bodies.inverse_mass[0] = velocity, inverse_inertia @ momentum, 1.0 / mass
    bodies.inverse_inertia[0] = symmetric(inverse_inertia)
    contacts.body[:] = contact_problem.WORLD, 0
    contacts.vector[contact_problem.ARM_SECOND], contacts.vector[contact_problem.NORMAL] = arm, normal
    contacts.vector[contact_problem.VELOCITY] = surface
    contacts.number[contact_problem.RESTITUTION], contacts.number[contact_problem.FRICTION] = law
    from_python(contact_problem.impact)(bodies, contacts, n)
    velocity[:] = bodies.velocity[0]
    momentum += np.cross(arm, contacts.vector[contact_problem.IMPULSE]).sum(axis=0)


def rows(matrix: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    """The rows of a matrix as compiled code takes vectors."""
    return tuple(tuple(map(float, row)) for row in matrix)


def resting(time: NDArray[np.float64], position: NDArray[np.float64]) -> Frames:
    """Frames of parts that are all there, upright and still, at positions (n, parts, 3)."""
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (*position.shape[:2], 1))
    return Frames(time, position, upright, 0 * position, 0 * position, np.ones(position.shape[:2], bool))


class StopsAfter(threading.Event):
    """Is set once the seeds have looked at it so many times; how often the main thread does is chance."""

    def __init__(self, looks: int) -> None:
        super().__init__()
        self._left = looks

    def is_set(self) -> bool:
        if threading.current_thread() is not threading.main_thread():
            self._left -= 1
        return self._left < 0 or super().is_set()


@contextmanager
def each_seed_stops_after(looks: int) -> Iterator[None]:
    """Runs within it are stopped once every seed has looked so many times, whichever seed has its turn first."""
    run = SeedRun.run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SeedRun, "run", lambda seed, stop: run(seed, StopsAfter(looks)))
        yield


@contextmanager
def moving_part(velocity: NDArray[np.float64], momentum: NDArray[np.float64]) -> Iterator[Any]:
    """A part of the impulse engine with this velocity and angular momentum (3,); what happens to it is written back."""
    from feeder_sim.engines.impulse.state import new_parts

    part = new_parts(np.zeros((1, 3)), np.eye(3)[None], [0], velocity)[0]
    part["momentum"] = momentum
    yield part
    velocity[:], momentum[:] = part["velocity"], part["momentum"]


@contextmanager
def changing(engine: ImpulseEngine) -> Iterator[NDArray[Any]]:
    """The parts of an engine as they were at the begin of its window, to be changed: it goes on from there."""
    state = opened(engine)
    yield state
    inertia = engine._kinds.record["inertia"][engine._parts["kind"]]
    rows = np.concatenate([state[name].reshape(len(state[name]), -1) for name in COLUMNS], axis=1)
    spin = np.einsum("pij,pj,pkj,pk->pi", state["attitude"], 1 / inertia, state["attitude"], state["momentum"])
    quaternion = Rotation.from_matrix(state["attitude"]).as_quat(scalar_first=True)
    engine._row[:] = np.concatenate([rows, quaternion, spin], axis=1)[: len(engine._row)]
    engine._parts = state.copy()
    if not engine._alone and engine._span[1] > engine._span[0]:
        engine._compute_window(engine._span[1])


def opened(engine: ImpulseEngine) -> NDArray[Any]:
    """The parts of an engine at the begin of the window under way; a single part as it is now."""
    return engine._parts if engine._alone else engine._opened


def hull_distances(scene: Scene, frames: Frames) -> NDArray[np.float64]:
    """Distance of all parts that are near each other, piece by piece, over all frames [m]."""
    from scipy.spatial import cKDTree

    from feeder_sim.engines.impulse.pairs.hulls import HullLibrary, hull_distance
    from feeder_sim.engines.impulse.state import new_parts

    pieces = [(k, points) for k, kind in enumerate(scene.kinds) for points in kind.pieces or (kind.corners,)]
    library = HullLibrary([points for _, points in pieces], [scene.kinds[k].corner_radius for k, _ in pieces])
    of_kind = [[number for number, (k, _) in enumerate(pieces) if k == kind] for kind in range(len(scene.kinds))]
    distance, largest = from_python(hull_distance), 2.0 * max(kind.size for kind in scene.kinds)
    hulls, found = library.hulls(), []
    for row in range(len(frames)):
        there = np.flatnonzero(frames.present[row])
        position = frames.position[row, there]
        turned = Rotation.from_quat(frames.quaternion[row, there], scalar_first=True).as_matrix()
        parts = new_parts(position, turned, scene.kind_of[there])
        for a, b in cKDTree(position).query_pairs(largest):
            for one, other in itertools.product(of_kind[parts[a]["kind"]], of_kind[parts[b]["kind"]]):
                found.append(distance(hulls, parts[a], one, parts[b], other, 1e-3))
    return np.array(found)

"""The model ladders: the wall time that each simplification of the drift saves, and how it changes the speed.

The first rung of a ladder is its full model, every other rung is one change of it. Rungs of different ladders are not
compared.

    strip, 4750 and 8775 Hz   impulses, six degrees of freedom, curved surface; one simplification per rung
    MuJoCo, 4750 Hz           contact set: hull against a sphere at every corner
    plate, 2797 Hz            mode of the 180 mm plate: curved, tangent plane, strip of the same frequency and
                              amplitude; and what the full model leaves out, the reaction of the nut on the plate
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Status
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scene.scene import build_scene
from feeder_sim.studies.chart.cases import CONTACT, Raw, speed, strip
from feeder_sim.studies.chart.data_files import Row, finite_rows, write_rows
from feeder_sim.studies.chart.shares import MUJOCO, Show, no_progress, shares

SLOW_LADDERS = ("MuJoCo, 4750 Hz",)  # not in the quick variant
ROUNDS, SEEDS, SLOW_SEEDS = 3, 12, 2
QUICK_ROUNDS, QUICK_SEEDS = 1, 4
Round = dict[str, tuple[list[float], float]]  # by model: transport speeds [mm/s], wall time per simulated time
PLATE_HZ, PLATE_UM = 2797.0, 5.0
PLATE_START_MM = 3.0  # from the antinode in the middle of the plate
PLATE_DURATION_S = 120.0


@dataclass(frozen=True)
class Rung:
    """One model of one ladder.

    Attributes:
        ladder, model: names; the first rung of a ladder is its full model.
        speed_mm_s, se_mm_s, n: transport speed and its standard error, over n seeds.
        change_percent, change_se_percent: change of the speed against the full model, and its standard error.
        saves: wall time per simulated second of the full model over that of this one.
        arrived: number of seeds that passed the end of the measured way, of all seeds.
    """

    ladder: str
    model: str
    speed_mm_s: float
    se_mm_s: float
    n: int
    change_percent: float
    change_se_percent: float
    saves: float
    arrived: str


def _nut(**changes: dict[str, object]) -> Callable[[], Raw]:
    """The nut at 4750 Hz with changes to tables of its scenario; see `_changed`."""
    return lambda: _changed(strip(4750.0, 1.0, 1.95), changes)


def _fast_nut(**changes: dict[str, object]) -> Callable[[], Raw]:
    """The nut at 8775 Hz, likewise."""
    return lambda: _changed(strip(8775.0, 1.0, 1.43), changes)


def _changed(raw: Raw, changes: dict[str, dict[str, object]]) -> Raw:
    """A scenario with changes by table; "start" and "drive" are those of the only part and drive."""
    for table, values in changes.items():
        if table == "start":
            raw["part"][0]["start"] |= values
        elif table == "drive":
            raw["drive"][0] |= values
        else:
            raw[table] = raw.get(table, {}) | values
    return raw


def _plate(**run: object) -> Raw:
    """The nut between the centre of the 180 mm plate, an antinode, and the nodal line around it."""
    start = {"position_mm": [PLATE_START_MM, 0.0], "drop_height_mm": [0.2, 0.5], "tilt_deg": [0.0, 3.0]}
    return {
        "plate": {"kind": "rectangle", "length_mm": 180.0, "width_mm": 180.0, "thickness_mm": 3.0},
        "drive": [{"frequency_hz": PLATE_HZ, "amplitude_um": PLATE_UM, "at_mm": [0.0, 0.0], "damping_ratio": 0.002}],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": PLATE_DURATION_S, "stop": "passage"} | run,
    }


def _plate_as_strip() -> Raw:
    """A strip of the same frequency and amplitude, with the nut at the same fraction of the way to the nodal line."""
    plate_cell = transport_cell(build_scene(validated(_plate(), Scenario, Path("ladder"))))
    assert plate_cell is not None
    fraction = 1.0 - 1e-3 * PLATE_START_MM / plate_cell.reach
    strip_cell = transport_cell(build_scene(validated(strip(PLATE_HZ, PLATE_UM, 1.0), Scenario, Path("ladder"))))
    assert strip_cell is not None
    raw = strip(PLATE_HZ, PLATE_UM, 1e3 * strip_cell.reach * (1.0 - fraction))
    raw["run"]["duration_s"] = PLATE_DURATION_S
    return raw


LADDERS: dict[str, dict[str, Callable[[], Raw]]] = {
    "strip, 4750 Hz": {
        "full": _nut(),
        "tangent plane": _nut(run={"tangent_surface": True}),
        "planar, corner ahead": _nut(run={"planar": True}, start={"yaw_deg": 0.0}),
        "planar, flat ahead": _nut(run={"planar": True}, start={"yaw_deg": 30.0}),
        "no ring-up": _nut(drive={"ring_up": False}),
        "no in-plane velocity": _nut(run={"in_plane_velocity": False, "duration_s": 120.0}),
    },
    "strip, 8775 Hz": {
        "full": _fast_nut(),
        "tangent plane": _fast_nut(run={"tangent_surface": True}),
        "planar, corner ahead": _fast_nut(run={"planar": True}, start={"yaw_deg": 0.0}),
        "no ring-up": _fast_nut(drive={"ring_up": False}),
        "no in-plane velocity": _fast_nut(run={"in_plane_velocity": False}),
    },
    "MuJoCo, 4750 Hz": {
        "hull": _nut(run={"engine": "mujoco"}, mujoco={"contact_set": "hull"}),
        "corner feet": _nut(run={"engine": "mujoco"}),
    },
    "plate, 2797 Hz": {
        "full": _plate,
        "tangent plane": lambda: _plate(tangent_surface=True),
        "strip": _plate_as_strip,
        "with reaction": lambda: _plate(reaction=True),
    },
}


def run_ladders(
    *, quick: bool, note: Callable[[str], None] = lambda _: None, progress: Show = no_progress
) -> list[Rung]:
    """Run the models of all ladders.

    The seeds of a model are divided into rounds, and in each round all models of a ladder run one after the other. The
    wall times that are compared are then close in time, which matters on a machine with a changing load.

    Args:
        quick: few seeds, and without the slow ladders.
        note: called with a line about each finished rung.
        progress: called with the fraction done.
    """
    rungs: list[Rung] = []
    ladders = {name: models for name, models in LADDERS.items() if not (quick and name in SLOW_LADDERS)}
    numbers = range(QUICK_ROUNDS if quick else ROUNDS)
    rounds_cost = [[_cost(make(), quick=quick) for make in models.values()] for models in ladders.values()]
    pieces = iter(shares(progress, [cost for costs in rounds_cost for _ in numbers for cost in costs]))
    for ladder, models in ladders.items():
        rounds = [
            {model: _run(scenario(), number, next(pieces), quick=quick) for model, scenario in models.items()}
            for number in numbers
        ]
        full_model = next(iter(models))
        for model in models:
            rung = _rung(ladder, model, full_model, rounds)
            rungs.append(rung)
            note(f"{ladder}, {model}: {rung.speed_mm_s:.3f} mm/s, saves {rung.saves:.2f}")
    return rungs


def _rung(ladder: str, model: str, full_model: str, rounds: Sequence[Round]) -> Rung:
    """Compare a model with the full model of its ladder."""
    speeds, full_speeds = ([value for results in rounds for value in results[name][0]] for name in (model, full_model))
    mean, full = Statistic.of(speeds), Statistic.of(full_speeds)
    ratio = mean.mean / full.mean
    ratio_se = ratio * math.hypot(mean.se / mean.mean, full.se / full.mean)
    is_full = model == full_model
    return Rung(
        ladder=ladder,
        model=model,
        speed_mm_s=mean.mean,
        se_mm_s=mean.se,
        n=mean.n,
        change_percent=0.0 if is_full else 100.0 * (ratio - 1.0),
        change_se_percent=0.0 if is_full else 100.0 * ratio_se,
        saves=statistics.median(results[full_model][1] / results[model][1] for results in rounds),
        arrived=f"{mean.n} of {len(speeds)}",
    )


def _slow(raw: Raw) -> bool:
    return raw["run"].get("engine") == "mujoco"


def _seeds(raw: Raw, *, quick: bool) -> int:
    """Number of seeds of a model in one round."""
    return QUICK_SEEDS if quick else SLOW_SEEDS if _slow(raw) else SEEDS


def _cost(raw: Raw, *, quick: bool) -> float:
    """How long a model takes in one round, about, in seeds of the impulses."""
    return _seeds(raw, quick=quick) * (MUJOCO if _slow(raw) else 1.0)


def _run(raw: Raw, number: int, progress: Show, *, quick: bool) -> tuple[list[float], float]:
    """Transport speeds [mm/s] of a model in one round, NaN for seeds that did not arrive; wall over simulated time."""
    raw["run"] |= {"seeds": _seeds(raw, quick=quick), "seed": number}
    result = simulate(validated(raw, Scenario, Path("ladder")), progress=progress)
    progress(1.0)
    simulated = sum(float(seed.frames.time[-1]) for seed in result.seeds)
    speeds = [speed(result.prepared, seed) if seed.status == Status.DONE else math.nan for seed in result.seeds]
    return speeds, sum(seed.wall_s for seed in result.seeds) / simulated


def rows_of(rungs: Sequence[Rung]) -> list[Row]:
    """The rungs as JSON takes them; the column with the name of the ladder is called "flight"."""
    return finite_rows(
        {"flight" if key == "ladder" else key: value for key, value in asdict(rung).items()} for rung in rungs
    )


def write_rungs(rungs: Sequence[Rung], folder: Path) -> None:
    """Write the rungs as CSV and as JSON; see `rows_of`."""
    write_rows(rows_of(rungs), folder, "ladder")

"""The model ladder: what each simplification of the drift saves, and what it costs in accuracy.

Every rung is one change of the full model of its flight of stairs; rungs of different flights are not compared.

    strip, 4750 and 8775 Hz   impulses, six degrees of freedom, curved surface: each simplification by itself
    MuJoCo, 4750 Hz           contact set: hull against a sphere at every corner
    plate, 2797 Hz            mode of the 180 mm plate: curved, tangent plane, strip of the same frequency and amplitude
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from feeder_sim.studies.chart.cases import CONTACT, Raw, speed, strip
from feeder_sim.studies.chart.data_files import write_rows
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scene.cell import transport_cell
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import build_scene
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario.tables import validated
from feeder_sim.records.trajectory import Status

SLOW_FLIGHTS = ("MuJoCo, 4750 Hz",)  # for the full ladder alone
ROUNDS, SEEDS, SLOW_SEEDS = 3, 12, 2
QUICK_ROUNDS, QUICK_SEEDS = 1, 4
PLATE_HZ, PLATE_UM = 2797.0, 5.0


@dataclass(frozen=True)
class Rung:
    """One model of one flight.

    Attributes:
        flight, model: which; the first rung of a flight is its full model.
        speed_mm_s, se_mm_s, n: transport speed and its standard error, over n seeds.
        change_percent, change_se_percent: of the speed, against the full model.
        saves: wall time of the full model over that of this one, for a simulated second.
        arrived: seeds that came to the end of the way, of all.
    """

    flight: str
    model: str
    speed_mm_s: float
    se_mm_s: float
    n: int
    change_percent: float
    change_se_percent: float
    saves: float
    arrived: str


def _nut(**changes: dict[str, object]) -> Callable[[], Raw]:
    """The nut at 4750 Hz with tables of its scenario changed."""
    return lambda: _changed(strip(4750.0, 1.0, 1.95), changes)


def _fast_nut(**changes: dict[str, object]) -> Callable[[], Raw]:
    return lambda: _changed(strip(8775.0, 1.0, 1.43), changes)


def _changed(raw: Raw, changes: dict[str, dict[str, object]]) -> Raw:
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
    start = {"position_mm": [3.0, 0.0], "drop_height_mm": [0.2, 0.5], "tilt_deg": [0.0, 3.0]}
    return {
        "plate": {"kind": "rectangle", "length_mm": 180.0, "width_mm": 180.0, "thickness_mm": 3.0},
        "drive": [{"frequency_hz": PLATE_HZ, "amplitude_um": PLATE_UM, "at_mm": [0.0, 0.0], "damping_ratio": 0.002}],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": 120.0, "stop": "passage"} | run,
    }


def _plate_as_strip() -> Raw:
    """A strip of the same frequency and amplitude, with the nut at the same share of the way."""
    scene = build_scene(validated(_plate(), Scenario, Path("ladder")))
    cell = transport_cell(scene)
    assert cell is not None
    share = 1.0 - 3e-3 / cell.reach
    slab = build_scene(validated(strip(PLATE_HZ, PLATE_UM, 1.0), Scenario, Path("ladder")))
    whole = transport_cell(slab)
    assert whole is not None
    raw = strip(PLATE_HZ, PLATE_UM, 1e3 * whole.reach * (1.0 - share))
    raw["run"]["duration_s"] = 120.0
    return raw


FLIGHTS: dict[str, dict[str, Callable[[], Raw]]] = {
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
    },
}


def climb(*, quick: bool, note: Callable[[str], None] = lambda _: None) -> list[Rung]:
    """Run every rung.

    The seeds of a rung are cut into rounds, and in each round all models of a flight run one after the other, so that
    what a model saves is a ratio of neighbours on a machine that is never the same for long.
    """
    rungs: list[Rung] = []
    for flight, models in FLIGHTS.items():
        if quick and flight in SLOW_FLIGHTS:
            continue
        rounds = [
            {model: _run(scenario(), number, quick=quick) for model, scenario in models.items()}
            for number in range(QUICK_ROUNDS if quick else ROUNDS)
        ]
        first = next(iter(models))
        full = Statistic.of(speed for held in rounds for speed in held[first][0])
        for model in models:
            speeds = [speed for held in rounds for speed in held[model][0]]
            found = Statistic.of(speeds)
            ratio = found.mean / full.mean
            spread = ratio * math.hypot(found.se / found.mean, full.se / full.mean)
            same = model == first
            rungs.append(
                Rung(
                    flight,
                    model,
                    found.mean,
                    found.se,
                    found.n,
                    0.0 if same else 100.0 * (ratio - 1.0),
                    0.0 if same else 100.0 * spread,
                    statistics.median(held[first][1] / held[model][1] for held in rounds),
                    f"{found.n} of {len(speeds)}",
                )
            )
            note(f"{flight}, {model}: {found.mean:.3f} mm/s, saves {rungs[-1].saves:.2f}")
    return rungs


def _run(raw: Raw, number: int, *, quick: bool) -> tuple[list[float], float]:
    """Transport speeds [mm/s] of a round, NaN for seeds that did not arrive; wall time per simulated second."""
    slow = raw["run"].get("engine") == "mujoco"
    seeds = QUICK_SEEDS if quick else SLOW_SEEDS if slow else SEEDS
    raw["run"] |= {"seeds": seeds, "seed": number}
    result = simulate(validated(raw, Scenario, Path("ladder")))
    simulated = sum(float(seed.frames.time[-1]) for seed in result.seeds)
    speeds = [speed(result.prepared, seed) if seed.status == Status.DONE else math.nan for seed in result.seeds]
    return speeds, sum(seed.wall_s for seed in result.seeds) / simulated


def write_rungs(rungs: Sequence[Rung], folder: Path) -> None:
    """Write the ladder as CSV and as JSON."""
    write_rows([asdict(rung) for rung in rungs], folder, "ladder")

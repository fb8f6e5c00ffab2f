"""Where engines fail: one picture per engine, of maps over two settings.

    python benchmarks/stability_maps.py [--quick] [--redraw] [--out benchmarks/chart]

Drift: a nut starts half way between antinode and node of a standing wave; its mean velocity over a short time is
compared with that without a step at the finest tolerance. Fall: a nut falls flat onto a plate at rest and leaves with e
times its speed. Stack: boxes stand on each other on a plate at rest, the uppermost of another mass. Each cell is a
scenario with one state, the worst that applies:

    tunnelling  the guard stopped the run because a centre or a corner lay too deep below the surface, or a part sank
    exploding   the guard stopped the run for its energy, or a part rose that had no energy to
    biased      drift or rebound differ by more than `BIAS` and by more than two standard errors, or a stack creeps
    unclear     the standard error is larger than `BIAS`
    stable      none of these

Writes stability.csv, .json and stability_ENGINE.png and .svg to the folder; with --redraw only the pictures, of the CSV
file there.
"""

from __future__ import annotations

import copy
import csv
import json
import math
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from chart_cases import CONTACT, Raw, after_impact, strip

from feeder_sim.constants import GRAVITY
from feeder_sim.document.figure import empty_figure
from feeder_sim.errors import Divergence
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

BIAS = 0.15  # relative deviation from the reference
EXPLODING_RISE = 5.0  # times the rise of the reference
LEAST_EXPLODING_RISE_MM = 2.0  # a smaller rise is never an explosion
NO_DRIFT_MM_S = 0.05  # a slower drift of the reference counts as none, since the nut hardly hops
DURATION_S = 0.5
SEEDS, MUJOCO_SEEDS, QUICK_SEEDS = 48, 6, 2
FAST, SLOW = 8775.0, 4750.0  # [Hz]
SLOW_HALF_WAY_MM = 9.7  # from the antinode at the lower frequency
FINEST_NM = 0.01  # tolerance of a reference
ENGINES = ("no step", "steps", "MuJoCo")
BOX_MM, OFFSET_MM = (5.0, 5.0, 2.0), 0.5  # each box the other way
STACK_S, LEAST_G = 0.5, 0.4
SUNK_MM, CREPT_MM = 0.05, 0.05  # of a stack that does not stand
COLUMNS, MOST_IN_TWO = 3, 4  # of a picture; maps that stand in two columns


class State(StrEnum):
    """State of a cell; the worst comes last."""

    STABLE = "stable"
    UNCLEAR = "unclear"
    BIASED = "biased"
    EXPLODING = "exploding"
    TUNNELLING = "tunnelling"


STATE_COLOURS = {
    State.STABLE: "#8fbf7f",
    State.UNCLEAR: "#dddddd",
    State.BIASED: "#f2cf63",
    State.EXPLODING: "#d9534f",
    State.TUNNELLING: "#6a4c93",
}
# The state of a cell; the relative deviation of its drift from the reference, NaN where none is defined; and the
# reason for the state, empty for a stable cell.
Verdict = tuple[State, Statistic, str]
Change = Callable[[Raw, float], None]  # turns a scenario into that of a method, at steps per period or a tolerance


def steps(raw: Raw, setting: float) -> None:
    """Impulses with default settings."""
    raw["run"] |= {"steps_per_period": int(setting), "engine": "impulse"}
    if setting < 20:
        raw["run"]["allow_unstable"] = True


def no_step(raw: Raw, setting: float) -> None:
    """Impulses without a step, at a tolerance [nm]."""
    raw["run"] |= {"engine": "impulse", "tolerance_nm": setting}


def mujoco(**settings: object) -> Change:
    """MuJoCo with values in the table [mujoco] that differ from the defaults of the package."""

    def change(raw: Raw, setting: float) -> None:
        raw["run"] |= {"steps_per_period": int(setting), "engine": "mujoco"}
        raw["mujoco"] = dict(settings)

    return change


def soft(time_constant_ms: float) -> Change:
    """MuJoCo's spring-damper contact with a time constant that does not depend on the step."""

    def change(raw: Raw, setting: float) -> None:
        mujoco()(raw, setting)
        raw["contact"] |= {"model": "compliant", "time_constant_us": 1e3 * time_constant_ms}

    return change


def compliant(steps_per_constant: int, **settings: object) -> Change:
    """MuJoCo's spring-damper contact with a time constant of a number of steps."""

    def change(raw: Raw, setting: float) -> None:
        step_ms = 1e3 / (raw["drive"][0]["frequency_hz"] * setting)
        soft(steps_per_constant * step_ms * (1 + 1e-9))(raw, setting)
        raw["mujoco"] = dict(settings)

    return change


@dataclass(frozen=True)
class Axis:
    """One setting of a map: its values, and those of the quick variant."""

    label: str
    values: tuple[float, ...]
    quick: tuple[float, ...]


@dataclass(frozen=True)
class StabilityMap:
    """A map over two settings.

    Attributes:
        engine: whose picture it stands in.
        name, title: in files and in the picture.
        x, y: the axes.
        verdict: on the cell of an x and a y; quick with few seeds.
    """

    engine: str
    name: str
    title: str
    x: Axis
    y: Axis
    verdict: Callable[[float, float, bool], Verdict]

    def settings(self, *, quick: bool) -> list[tuple[float, float]]:
        """The x and y of all cells, row by row."""
        xs, ys = (axis.quick if quick else axis.values for axis in (self.x, self.y))
        return [(x, y) for y in ys for x in xs]

    def judge(self, x: float, y: float, *, quick: bool) -> Verdict:
        """Compute the cell of two settings; `quick` with few seeds."""
        return self.verdict(x, y, quick)


@dataclass(frozen=True)
class MapCell:
    """One cell of a map.

    Attributes:
        map: name of the map.
        x, y: values of the settings.
        state: of the cell.
        deviation, se: relative deviation of its drift from the reference, and its standard error; None without one.
        why: reason for the state; empty for a stable cell.
    """

    map: str
    x: float
    y: float
    state: State
    deviation: float | None
    se: float | None
    why: str


@cache
def _reference(text: str, seeds: int) -> Result:
    """The run of a scenario as JSON: many cells have the same reference."""
    return _run(json.loads(text), seeds)


def _run(raw: Raw, seeds: int) -> Result:
    raw["run"]["seeds"] = seeds
    return simulate(validated(raw, Scenario, Path("stability")))


def half_way(frequency: float, amplitude_um: float = 1.0, **contact: float) -> Raw:
    """A nut half way between antinode and node of a wave without ring-up; `contact` changes the table [contact]."""
    raw = strip(frequency, amplitude_um, 1.0)
    # The wavelength of bending waves is proportional to 1 / sqrt(frequency).
    raw["part"][0]["start"]["position_mm"] = [SLOW_HALF_WAY_MM * math.sqrt(SLOW / frequency), 0.0]
    raw["drive"][0] |= {"ring_up": False}
    raw["contact"] |= contact
    raw["run"] = {"duration_s": DURATION_S, "allow_unstable": True}
    return raw


def made_by(change: Change, setting: float, raw: Raw) -> Raw:
    """Change a scenario in place to that of a method at a setting, and return it."""
    change(raw, setting)
    return raw


def _drift(raw: Raw, quick: bool) -> Callable[[Change, float], Verdict]:
    """Judges methods at a setting by the drift of a scenario."""

    def judged(change: Change, setting: float) -> Verdict:
        finest = made_by(no_step, FINEST_NM, copy.deepcopy(raw))
        reference = _reference(json.dumps(finest), QUICK_SEEDS if quick else SEEDS)
        of_method = made_by(change, setting, copy.deepcopy(raw))
        seeds = MUJOCO_SEEDS if of_method["run"]["engine"] == "mujoco" else SEEDS
        return classify(_run(of_method, QUICK_SEEDS if quick else seeds), reference)

    return judged


def _fall(speed: float, change: Change, setting: float) -> Verdict:
    """Judges the rebound of a nut that falls flat, by restitution times its speed."""
    result = _run(falling(speed, change, setting), 1)
    verdict = classify(result, None)
    if verdict[0] != State.STABLE:
        return verdict
    upward, _ = after_impact(result.prepared.scene, result.seeds[0])
    approach = math.sqrt(speed**2 + 2.0 * GRAVITY * 1e-4)  # from 0.1 mm
    rebound = upward / (CONTACT["restitution"] * approach)
    return by_deviation(Statistic(rebound - 1.0, math.nan, 0.0, 1))


def stacked(count: int, ratio: float, change: Change, setting: float) -> Raw:
    """Boxes on each other on a plate at rest, the uppermost so many times as heavy as each other one."""
    raw: Raw = {
        "plate": {"kind": "still", "length_mm": 100.0, "width_mm": 100.0},
        "part": [
            {
                "shape": "box",
                "size_mm": list(BOX_MM),
                "mass_g": LEAST_G * (ratio if k == count - 1 else 1.0),
                "inertia_g_mm2": [LEAST_G * (ratio if k == count - 1 else 1.0) * i for i in _box_inertia()],
                "start": {
                    "kind": "state",
                    "position_mm": [OFFSET_MM * (-1) ** k, 0.0, (k + 0.5) * BOX_MM[2] + 1e-3 * (k + 1)],
                },
            }
            for k in range(count)
        ],
        "contact": CONTACT | {"part_restitution": CONTACT["restitution"], "part_friction": CONTACT["friction"]},
        "run": {"duration_s": STACK_S, "allow_unstable": True, "frames_per_second": 200.0},
    }
    return made_by(change, setting, raw)


def _height_mm(k: int) -> float:
    """Of the centre of a box of a stack, a micrometre over the one below."""
    return (k + 0.5) * BOX_MM[2] + 1e-3 * (k + 1)


def _box_inertia() -> list[float]:
    """Of a box of 1 g [g mm2]."""
    squares = [side**2 for side in BOX_MM]
    return [(sum(squares) - square) / 12.0 for square in squares]


def _stack(count: float, ratio: float, change: Change, setting: float) -> Verdict:
    """Judges whether a stack stands: nothing sinks, creeps or rises."""
    result = _run(stacked(int(count), ratio, change, setting), 1)
    verdict = classify(result, None)
    if verdict[0] != State.STABLE:
        return verdict
    place, undefined = 1e3 * result.seeds[0].frames.position, Statistic(math.nan, math.nan, math.nan, 0)
    moved = place - place[0]
    if -moved[:, :, 2].min() > SUNK_MM:
        return State.TUNNELLING, undefined, f"sinks by {-moved[:, :, 2].min():.2g} mm"
    if moved[:, :, 2].max() > SUNK_MM:
        return State.EXPLODING, undefined, f"rises by {moved[:, :, 2].max():.2g} mm"
    crept = float(np.hypot(moved[:, :, 0], moved[:, :, 1]).max())
    return (State.STABLE, undefined, "") if crept < CREPT_MM else (State.BIASED, undefined, f"creeps by {crept:.2g} mm")


def falling(speed: float, change: Change, setting: float) -> Raw:
    """A nut that falls onto a plate of 3 mm at rest.

    Args:
        speed: of the nut at the start, 0.1 mm above the plate [m/s].
        change: the method.
        setting: its solver steps per millisecond, or its tolerance [nm].
    """
    start = {"drop_height_mm": 0.1, "tilt_deg": 0.0, "velocity_mm_s": [0.0, 0.0, -1e3 * speed]}
    raw: Raw = {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": 1000.0, "amplitude_um": 0.0}],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": 0.1, "allow_unstable": True, "frames_per_second": 10000.0},
    }
    return made_by(change, setting, raw)


STEPS = Axis("steps per period", (5, 10, 20, 40, 80), (10, 40))
RESTITUTION = Axis("restitution", (0.0, 0.1, 0.2, 0.4, 0.6), (0.2, 0.4))
FREQUENCY = Axis("frequency (Hz)", (2000, 4750, 8775, 12000), (4750,))
AMPLITUDE = Axis("amplitude (µm)", (0.3, 1, 3, 10), (1, 10))
SPEED = Axis("speed of the impact (m/s)", (0.1, 0.3, 1, 3, 10), (1, 10))
TOLERANCE = Axis("tolerance (nm)", (0.01, 0.1, 1, 10, 100), (0.1, 10))
PER_MS = Axis("steps per millisecond", (5, 10, 20, 40, 80), (10, 40))
BOXES = Axis("boxes", (2, 4, 6, 8, 12), (2, 4))
RATIO = Axis("mass of the uppermost over the others", (0.01, 1, 10, 100, 1000), (1, 10))


def _over_steps(engine: str, change: Change, x: Axis = STEPS) -> StabilityMap:
    """Drift over the setting of a method and the restitution."""
    return StabilityMap(
        engine,
        f"{engine}: drift, setting",
        "drift at 8775 Hz",
        x,
        RESTITUTION,
        lambda x, y, quick: _drift(half_way(FAST, restitution=y), quick)(change, x),
    )


def _over_drives(engine: str, change: Change, setting: float, words: str) -> StabilityMap:
    """Drift over the frequency and the amplitude of the drive."""
    return StabilityMap(
        engine,
        f"{engine}: drift, drive",
        f"drift, {words}",
        FREQUENCY,
        AMPLITUDE,
        lambda x, y, quick: _drift(half_way(x, y), quick)(change, setting),
    )


def _over_falls(engine: str, change: Change, y: Axis) -> StabilityMap:
    """Rebound over the speed of a fall and the setting."""
    return StabilityMap(engine, f"{engine}: fall", "rebound of a fall", SPEED, y, lambda x, y, _: _fall(x, change, y))


def _over_stacks(engine: str, change: Change, setting: float, words: str) -> StabilityMap:
    """A stack over its boxes and the mass of the uppermost."""
    name, title = f"{engine}: stack", f"a stack, {words}"
    return StabilityMap(engine, name, title, BOXES, RATIO, lambda x, y, _: _stack(x, y, change, setting))


NO_STEP, IN_STEPS, IN_MUJOCO = ENGINES
MAPS = (
    _over_steps(NO_STEP, no_step, TOLERANCE),
    _over_drives(NO_STEP, no_step, 0.1, "0.1 nm"),
    _over_falls(NO_STEP, no_step, TOLERANCE),
    _over_stacks(NO_STEP, no_step, 0.1, "0.1 nm"),
    _over_steps(IN_STEPS, steps),
    _over_drives(IN_STEPS, steps, 40, "40 steps"),
    _over_falls(IN_STEPS, steps, PER_MS),
    _over_stacks(IN_STEPS, steps, 40, "40 steps in 4 ms"),
    _over_steps(IN_MUJOCO, mujoco()),
    _over_drives(IN_MUJOCO, mujoco(), 40, "40 steps"),
    _over_falls(IN_MUJOCO, mujoco(), PER_MS),
    _over_stacks(IN_MUJOCO, mujoco(), 40, "40 steps in 4 ms"),
    StabilityMap(
        IN_MUJOCO,
        "MuJoCo: compliant, drift",
        "compliant contact: drift at 8775 Hz",
        STEPS,
        Axis("time constant (steps)", (1, 2, 5, 10, 20), (1, 5)),
        lambda x, y, quick: _drift(half_way(FAST), quick)(compliant(int(y), refsafe=False), x),
    ),
    StabilityMap(
        IN_MUJOCO,
        "MuJoCo: compliant, fall",
        "compliant contact: fall on a plate of 3 mm",
        SPEED,
        Axis("time constant (ms)", (0.1, 0.3, 1, 3, 10), (0.3, 10)),
        lambda x, y, _: classify(_run(falling(x, soft(y), max(20, math.ceil(20.0 / y))), MUJOCO_SEEDS), None),
    ),
)


def classify(result: Result, reference: Result | None) -> Verdict:
    """Compare a cell with its reference."""
    undefined = Statistic(math.nan, math.nan, math.nan, 0)
    for failure in result.failures:
        tunnels = failure.divergence in (Divergence.THROUGH_PLATE, Divergence.TOO_DEEP)
        return State.TUNNELLING if tunnels else State.EXPLODING, undefined, failure.cause
    if reference is None:
        return State.STABLE, undefined, ""
    rise, expected_rise = (r.measures()["highest_rise_mm"]["mean"] for r in (result, reference))
    if rise > max(EXPLODING_RISE * expected_rise, LEAST_EXPLODING_RISE_MM):
        return State.EXPLODING, undefined, f"rises {rise:.3g} mm instead of {expected_rise:.3g} mm"
    drift, expected = (r.measures()["drift_velocity_x_mm_s"] for r in (result, reference))
    if abs(expected["mean"]) < NO_DRIFT_MM_S:
        larger_se = max(drift["se"] or 0.0, expected["se"] or 0.0)
        if larger_se > NO_DRIFT_MM_S:
            return State.UNCLEAR, undefined, f"drift known to {larger_se:.2g} mm/s only"
        still = abs(drift["mean"]) < 2.0 * NO_DRIFT_MM_S
        why = f"drifts at {drift['mean']:.2f} mm/s, should not"
        return (State.STABLE, undefined, "") if still else (State.BIASED, undefined, why)
    relative = drift["mean"] / expected["mean"] - 1.0
    se = math.hypot(drift["se"] or 0.0, expected["se"] or 0.0) / abs(expected["mean"])
    return by_deviation(Statistic(relative, math.nan, se, drift["n"]))


def by_deviation(deviation: Statistic) -> Verdict:
    """The verdict on a cell whose drift deviates by so much from the reference [1]; NaN where it is not known."""
    relative, se = deviation.mean, deviation.se
    if abs(relative) > BIAS and abs(relative) > 2.0 * se:
        return State.BIASED, deviation, f"drift off by {100.0 * relative:+.0f} %"
    if se <= BIAS:
        return State.STABLE, deviation, ""
    known = f"known to {100.0 * se:.0f} % only" if se > BIAS else "not known"
    return State.UNCLEAR, deviation, f"drift {known}"


def fill(maps: Sequence[StabilityMap] = MAPS, *, quick: bool) -> list[MapCell]:
    """Compute every cell of the maps, with a line about each; `quick` with few seeds and few values."""
    wanted = [(of, x, y) for of in maps for x, y in of.settings(quick=quick)]
    cells: list[MapCell] = []
    for of, x, y in wanted:
        state, deviation, why = of.judge(x, y, quick=quick)
        relative, se = (v if math.isfinite(v) else None for v in (deviation.mean, deviation.se))
        cells.append(MapCell(of.name, x, y, state, relative, se, why))
        done = f"{len(cells)}/{len(wanted)}"
        print(f"{done} {of.title}, {of.x.label} {x:g}, {of.y.label} {y:g}: {state} {why}", file=sys.stderr, flush=True)
    return cells


def write_cells(cells: Sequence[MapCell], folder: Path) -> None:
    """Write the cells of all maps as CSV and as JSON."""
    rows = [asdict(cell) for cell in cells]
    with (folder / "stability.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (folder / "stability.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")


def read_cells(folder: Path) -> list[MapCell]:
    """The cells of a folder's stability.csv."""

    def number(text: str) -> float | None:
        return float(text) if text else None

    with (folder / "stability.csv").open(newline="", encoding="utf-8") as file:
        return [
            MapCell(of, float(x), float(y), State(state), number(deviation), number(se), why)
            for of, x, y, state, deviation, se, why in list(csv.reader(file))[1:]
        ]


def draw_stability(cells: Sequence[MapCell], folder: Path) -> None:
    """Draw the maps, a picture per engine: the colour shows the state, the number the deviation in percent."""
    from matplotlib.patches import Patch

    for engine in ENGINES:
        maps = [of for of in MAPS if of.engine == engine and any(cell.map == of.name for cell in cells)]
        if not maps:
            continue
        columns = COLUMNS if len(maps) > MOST_IN_TWO else 2
        rows = math.ceil(len(maps) / columns)
        figure = empty_figure(4.6 * columns, 3.6 * rows + 0.6)
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for spare in panels[len(maps) :]:
            spare.set_axis_off()
        for axes, of in zip(panels, maps, strict=False):
            _draw_map(axes, of, [cell for cell in cells if cell.map == of.name])
        figure.suptitle(engine)
        handles = [Patch(color=colour, label=str(state)) for state, colour in STATE_COLOURS.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
        for suffix in (".png", ".svg"):
            figure.savefig((folder / f"stability_{engine.replace(' ', '_').lower()}").with_suffix(suffix), dpi=130)


def _draw_map(axes: Any, of: StabilityMap, cells: Sequence[MapCell]) -> None:
    xs, ys = sorted({cell.x for cell in cells}), sorted({cell.y for cell in cells})
    for cell in cells:
        i, j = xs.index(cell.x), ys.index(cell.y)
        axes.fill([i, i + 1, i + 1, i], [j, j, j + 1, j + 1], color=STATE_COLOURS[cell.state], edgecolor="white")
        if cell.deviation is not None:
            axes.text(i + 0.5, j + 0.5, f"{100.0 * cell.deviation:+.0f}", ha="center", va="center", fontsize=7)
    axes.set_xticks([i + 0.5 for i in range(len(xs))], [f"{v:g}" for v in xs])
    axes.set_yticks([j + 0.5 for j in range(len(ys))], [f"{v:g}" for v in ys])
    axes.set_title(of.title, fontsize=10)
    axes.set(xlabel=of.x.label, ylabel=of.y.label, xlim=(0, len(xs)), ylim=(0, len(ys)))


def main(
    quick: Annotated[bool, typer.Option("--quick", help="few seeds and coarse maps")] = False,
    redraw: Annotated[bool, typer.Option("--redraw", help="only draw the CSV file that is there")] = False,
    out: Annotated[Path, typer.Option("--out", help="folder")] = Path(__file__).parent / "chart",
) -> None:
    out.mkdir(parents=True, exist_ok=True)
    cells = read_cells(out) if redraw else fill(quick=quick)
    if not redraw:
        write_cells(cells, out)
    draw_stability(cells, out)
    for state, number in sorted(Counter(str(cell.state) for cell in cells).items()):
        print(f"{state}: {number} of {len(cells)} cells")


if __name__ == "__main__":
    typer.run(main)

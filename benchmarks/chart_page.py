"""Pictures and tables of docs/choosing.md, from the files of chart.py.

Tables replace what stands between `<!-- NAME -->` and `<!-- end -->` in the page.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chart_cases import BALL_HZ, BALL_UM, CONTACT
from chart_scenes import SCENES, Row, Scene
from right_values import ball_height
from stability_maps import ENGINES, MAPS, State, read_cells

from feeder_sim.document.figure import empty_figure, make_logarithmic
from feeder_sim.plots.intervals import COLOURS
from feeder_sim.studies.chart.settings import MUJOCO, NO_STEP, SIMPLIFIED, STEPS

ALIKE, SURE = 1.4, 2.0  # ratio of costs that count as equal; standard errors
NEAR = 0.1  # [%]; errors that differ by less count as equal
LEAST = 1e-3  # [%]; what is drawn for a smaller error
COLUMNS, DECADES = 4, 2.0  # of the picture; on an axis from which powers of ten alone are marked
FINEST, MAP = "finest", "drift map"
END = "<!-- end -->"
OWN = {NO_STEP: COLOURS[0], STEPS: COLOURS[2], MUJOCO: COLOURS[1], "drops": COLOURS[0], MAP: COLOURS[3]}
OWN_NAMES = {NO_STEP: "no step", STEPS: "steps", MUJOCO: "MuJoCo engine", "drops": "no step", MAP: MAP}
OTHERS = {
    "Bullet": "#6b8e23",
    "Rapier": "#b3261e",
    "plain MuJoCo": "#d9a441",
    "Drake, TAMSI": "#7a6a5a",
    "Drake, SAP": "#a99a8a",
    "Drake, CENIC": "#444444",
    "Drake, Runge-Kutta": "#888888",
}
NUMBERS = ("value", "se", "error", "error_se", "cost", "wall_s")
POINTS_OF = {"bouncing_ball", "drift_4750", "drift_8775"}  # cases whose value is no error yet
SENTENCES = {
    "no step": "The tolerance does not matter from 0.01 to 100 nm, and stacks of any mass ratio stand.",
    "steps": "A heavy box on six and more light ones presses them into each other, and a drift that hardly hops is too "
    "slow.",
    "MuJoCo": "Below 40 steps, and with larger restitution, drifts are too slow; compliant contact explodes at a time "
    "constant of one step, drifts wrongly from ten on, and lets fast parts through.",
}


# --- reading ----------------------------------------------------------------------------------------------------------


def read_rows(folder: Path) -> list[Row]:
    """Rows of this package and of other simulators, each beside the right value of its scene."""
    rows = own_rows(folder / "own.csv")
    scenes = {scene.case: scene for scene in SCENES if scene.case}
    peers = folder / "peers.csv"
    if peers.exists():
        with peers.open(newline="", encoding="utf-8") as file:
            rows += [_peer(record, scenes[record["case"]], rows) for record in csv.DictReader(file)]
    return rows


def own_rows(path: Path) -> list[Row]:
    """Rows of this package."""
    with path.open(newline="", encoding="utf-8") as file:
        return [_own(record) for record in csv.DictReader(file)]


def _own(record: dict[str, str]) -> Row:
    value, se, error, error_se, cost, wall = (_number(record[name]) for name in NUMBERS)
    scene, method, setting = (record[name] for name in ("scene", "method", "setting"))
    numbers = value, se, int(record["n"]), error, error_se, cost, wall
    return Row(scene, method, setting, *numbers, record["failure"], record["default"] == "True")


def _number(text: str) -> float:
    return float(text) if text else math.nan


def _peer(record: dict[str, str], scene: Scene, own: Sequence[Row]) -> Row:
    value, se = _number(record["value"]), _number(record["se"])
    error, error_se = value, 0.0 if math.isnan(se) else se
    if record["case"] in POINTS_OF:
        right, right_se = _right_value(scene, own)
        error = 100.0 * abs(value / right - 1.0)
        if record["case"] != "bouncing_ball" and math.isnan(se):  # of one seed, which scatters as one of the reference
            se = right_se * math.sqrt(reference(scene, own).n)
        error_se = 100.0 * math.hypot(0.0 if math.isnan(se) else se, right_se) / right
    numbers = value, se, int(record["n"]), error, error_se, _number(record["cost"]), _number(record["wall_s"])
    method, _, suffix = record["method"].partition(", ")
    if f"{method}, {suffix}" in OTHERS:
        method, suffix = f"{method}, {suffix}", ""
    setting = f"{record['setting']} steps" + (f", {suffix}" if suffix else "")
    return Row(scene.name, method, setting, *numbers, record["failure"])


def _right_value(scene: Scene, own: Sequence[Row]) -> tuple[float, float]:
    if scene.case == "bouncing_ball":
        return 1e3 * ball_height(BALL_HZ, 1e-6 * BALL_UM, CONTACT["restitution"]), 0.0
    right = reference(scene, own)
    return right.value, right.se


def reference(scene: Scene, rows: Sequence[Row]) -> Row:
    """The finest setting without a step."""
    return [row for row in rows if row.scene == scene.name and row.method == NO_STEP][-1]


# --- judging ----------------------------------------------------------------------------------------------------------


def of(scene: Scene, rows: Sequence[Row]) -> list[Row]:
    """What can be chosen in a scene: it has an error, leaves nothing out, and is not what errors are against."""
    known = [row for row in rows if row.scene == scene.name and row.method != SIMPLIFIED]
    by_itself = reference(scene, rows) if FINEST in scene.right else None
    return [row for row in known if row is not by_itself and math.isfinite(row.error) and math.isfinite(row.cost)]


def better(row: Row, than: Row) -> bool:
    """Cheaper and as near, or as cheap and nearer."""
    apart = SURE * math.hypot(row.error_se, than.error_se) + NEAR
    cheaper = row.cost * ALIKE <= than.cost and row.error <= than.error + apart
    return cheaper or (row.cost <= than.cost * ALIKE and row.error < than.error - apart)


def front(rows: Sequence[Row]) -> list[Row]:
    """Those that nothing else is better than."""
    return [row for row in rows if not any(better(other, row) for other in rows if other is not row)]


def default_of(scene: Scene, rows: Sequence[Row]) -> Row:
    return next(row for row in of(scene, rows) if row.default)


def verdict(scene: Scene, rows: Sequence[Row]) -> str:
    """What to choose."""
    choices, default = of(scene, rows), default_of(scene, rows)
    others = [row for row in choices if better(row, default)]
    engines = [row for row in others if row.method != MAP]
    best = min(engines, key=lambda row: row.cost, default=None)
    text = f"{named(best)}: {_cost(best)} of the cost, {percent(best)}" if best else "the default"
    return text + "".join(
        f"; for the mean way a {MAP}: {_cost(row)}, {percent(row)}" for row in others if row.method == MAP
    )


def _cost(row: Row) -> str:
    """Over the default's, two digits."""
    return f"{float(f'{row.cost:.2g}'):g}"


def named(row: Row) -> str:
    """Method and setting."""
    method = OWN_NAMES.get(row.method, row.method)
    setting = row.setting.removeprefix("no step, ").removeprefix("MuJoCo, ").removeprefix("no step")
    return f"{method}, {setting}" if setting and row.method != "drops" else method


def percent(row: Row) -> str:
    """The error, with two standard errors where it has one."""
    if row.error < LEAST and not row.error_se:
        return f"below {LEAST:g} %"
    if row.error < NEAR and not row.error_se:
        return f"{row.error:.1g} %"
    digits = 0 if row.error >= 10.0 else 1 if row.error >= 1.0 or row.error_se else 2
    spread = f" ± {SURE * row.error_se:.{max(digits, 1)}f}" if row.error_se else ""
    return f"{row.error:.{digits}f}{spread} %"


# --- the page ---------------------------------------------------------------------------------------------------------


def write_page(rows: Sequence[Row], folder: Path, page: Path) -> None:
    """Put the tables into the page."""
    text = page.read_text(encoding="utf-8")
    for name, fragment in FRAGMENTS.items():
        before, start, rest = text.partition(f"<!-- {name} -->\n")
        _, end, after = rest.partition(END)
        if not start or not end:
            raise ValueError(f"{page}: <!-- {name} --> and {END} are missing")
        text = before + start + fragment(rows, folder) + "\n" + end + after
    page.write_text(text, encoding="utf-8")


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *lines))


def decide(rows: Sequence[Row], _: Path) -> str:
    """What to choose in each scene."""
    lines = []
    for scene in SCENES:
        default = default_of(scene, rows)
        lines.append((scene.title, named(default), percent(default), verdict(scene, rows)))
    return table(("scene", "default", "its error", "choose"), lines)


def simulators(rows: Sequence[Row], _: Path) -> str:
    """The nearest setting of every other method, with its cost."""
    names = [MUJOCO, *OTHERS]
    lines = []
    for scene in SCENES:
        cells = []
        for name in names:
            points = [row for row in of(scene, rows) if row.method == name]
            failed = [row for row in rows if row.scene == scene.name and row.method == name and row.failure]
            if points:
                nearest = min(points, key=lambda row: (row.error, row.cost))
                cells.append(f"{percent(nearest)}, {_cost(nearest)}x")
            else:
                cells.append(failed[0].failure.partition(";")[0] if failed else "-")
        lines.append((scene.title, *cells))
    return table(("scene", *(OWN_NAMES.get(name, name) for name in names)), lines)


def references(rows: Sequence[Row], _: Path) -> str:
    """What is right in each scene, and by how much it moves."""
    lines = []
    for scene in SCENES:
        checks = "-"
        settings = [row for row in rows if row.scene == scene.name and row.method == NO_STEP]
        if FINEST in scene.right:
            stepped = [row for row in rows if row.scene == scene.name and row.method == STEPS]
            checks = f"next finest {percent(settings[-2])} off, {stepped[-1].setting} {percent(stepped[-1])}"
        lines.append((scene.title, scene.measure, scene.right, checks))
    return table(("scene", "measure", "what is right", "what checks it"), lines)


def ladder(rows: Sequence[Row], _: Path) -> str:
    """What it changes to leave an effect out."""
    lines = []
    for row in rows:
        if row.method == SIMPLIFIED:
            title = next(scene.title for scene in SCENES if scene.name == row.scene)
            change = row.failure or f"{percent(row)}"
            lines.append((title, row.setting, change, f"{row.cost:.2g}"))
    return table(("scene", "changed", "changes the result by", "cost"), lines)


def maps(_: Sequence[Row], folder: Path) -> str:
    """A picture and a sentence of each engine."""
    cells, texts = read_cells(folder), []
    for engine in ENGINES:
        names = {each.name for each in MAPS if each.engine == engine}
        states = Counter(cell.state for cell in cells if cell.map in names)
        counted = ", ".join(f"{states[state]} {state}" for state in State if states[state])
        file = f"../benchmarks/chart/stability_{engine.replace(' ', '_').lower()}.png"
        texts.append(f"![Stability maps of {engine}]({file})\n\n**{engine}**: {counted}. {SENTENCES[engine]}")
    return "\n\n".join(texts)


def made(_: Sequence[Row], folder: Path) -> str:
    """Which commit and machine made it."""
    record: dict[str, Any] = tomllib.loads((folder / "chart.toml").read_text(encoding="utf-8"))
    versions = ", ".join(f"{name} {number}" for name, number in record["versions"].items() if name != "feeder-sim")
    day, machine = record["day"], record["machine"]
    return f"Made at {record['commit']} on {day}, two cores of an {machine}, Python {record['python']}, {versions}."


FRAGMENTS: dict[str, Callable[[Sequence[Row], Path], str]] = {
    "decide": decide,
    "simulators": simulators,
    "references": references,
    "ladder": ladder,
    "maps": maps,
    "made": made,
}


# --- the picture ------------------------------------------------------------------------------------------------------


def draw(rows: Sequence[Row], folder: Path) -> None:
    """One panel per scene: error over cost of all methods, the front as a band, the default with a ring."""
    panels = [scene for scene in SCENES if of(scene, rows)]
    figure = empty_figure(4.1 * COLUMNS, 3.5 * math.ceil(len(panels) / COLUMNS) + 0.5)
    grid = figure.subplots(math.ceil(len(panels) / COLUMNS), COLUMNS, squeeze=False).ravel()
    labels: dict[str, Any] = {}
    for axes, scene in zip(grid, panels, strict=False):
        _draw_scene(axes, scene, of(scene, rows), labels)
    for spare in grid[len(panels) :]:
        spare.set_axis_off()
    figure.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=7, frameon=False, fontsize=9)
    for suffix in (".png", ".svg"):
        figure.savefig((folder / "methods").with_suffix(suffix), dpi=110)


def _draw_scene(axes: Any, scene: Scene, rows: Sequence[Row], labels: dict[str, Any]) -> None:
    best = sorted(front([row for row in rows if row.method != MAP]), key=lambda row: row.cost)
    axes.plot([r.cost for r in best], [_drawn(r) for r in best], color="#f0d9a0", linewidth=9, alpha=0.6, zorder=0)
    for method, suffix in dict.fromkeys(_line_of(row) for row in rows):
        points = [row for row in rows if _line_of(row) == (method, suffix)]
        colour = OWN.get(method) or OTHERS.get(method, "#bbbbbb")
        x, y = [row.cost for row in points], [_drawn(row) for row in points]
        reach = [SURE * row.error_se for row in points]
        low = [min(r, 0.8 * e) for r, e in zip(reach, y, strict=True)]
        axes.errorbar(x, y, [low, reach], fmt="none", ecolor=colour, alpha=0.4, linewidth=1.0)
        (line,) = axes.plot(x, y, "o-" if method in OWN else "s--", color=colour, markersize=4, linewidth=1.0)
        labels.setdefault(OWN_NAMES.get(method, method), line)
    for row in rows:
        if row.default:
            axes.plot(row.cost, _drawn(row), "o", markersize=11, markerfacecolor="none", markeredgecolor="black")
    axes.axhline(5.0, color="0.5", linewidth=0.8, linestyle=":")
    axes.loglog()
    for axis, values in ((axes.xaxis, [row.cost for row in rows]), (axes.yaxis, [_drawn(row) for row in rows])):
        if math.log10(max(values) / min(values)) <= DECADES:
            make_logarithmic(axis)
    axes.set(title=scene.title, xlabel="cost over the default's", ylabel="error (%)")
    axes.title.set_fontsize(10)
    axes.grid(True, alpha=0.3)


def _line_of(row: Row) -> tuple[str, str]:
    """Settings that differ in their steps alone are one line."""
    return row.method, "" if row.method in OWN else row.setting.partition(", ")[2]


def _drawn(row: Row) -> float:
    """The error; one that its standard error hides is drawn as that."""
    return max(row.error, row.error_se, LEAST)

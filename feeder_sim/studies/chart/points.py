"""Points of the chart: value, error and cost of a method at a setting on a case; the front that no point beats."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from feeder_sim.engines.lookup import engine_class
from feeder_sim.errors import InputError
from feeder_sim.measures.statistic import Statistic
from feeder_sim.records.seed import Seed, Status
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.chart.cases import Case
from feeder_sim.studies.chart.data_files import Row, finite_rows, write_rows
from feeder_sim.studies.chart.methods import DEFAULT_STEPS, METHODS, Method
from feeder_sim.studies.chart.shares import Show, no_progress, shares

SEEDS_TO_FAIL = 2  # of a method that is known to fail
REPEAT_S = 0.5  # wall time over which a case without chance is repeated; the shortest run counts
ALIKE = 1.25  # costs within this factor cannot be distinguished on a shared machine
LEAST_PERCENT = 0.1  # smaller errors count as this
FINEST = 160  # steps per period of a reference
QUICK_FINEST = 80  # the same in the quick variant
LARGEST_PERCENT = 100.0  # a point with a larger error counts as a failure


@dataclass(frozen=True)
class Point:
    """One method at one setting on one case.

    Attributes:
        case, method: their names.
        setting: see `Method.settings`.
        value, se, n: the number of the case, its standard error, and the number of seeds; NaN where there is none.
        reference, reference_se: exact or reference value of the case, and its standard error.
        wall_s_per_simulated_s: on one core.
        failure: why the point does not count; empty if it does.
        details: meaning of the setting, and why the method is known to fail if it is.
    """

    case: str
    method: str
    setting: int
    value: float
    se: float
    n: int
    reference: float
    reference_se: float
    wall_s_per_simulated_s: float
    failure: str = ""
    details: str = ""

    @property
    def error_percent(self) -> float:
        """Error [%]: deviation from the reference, or its standard error if that is larger.

        With a reference of 0 the value is itself an error in percent.
        """
        if self.reference == 0.0:
            return max(abs(self.value), LEAST_PERCENT)
        return max(100.0 * abs(self.value / self.reference - 1.0), self.error_se_percent, LEAST_PERCENT)

    @property
    def error_se_percent(self) -> float:
        """Standard error of the deviation [%]."""
        if self.reference == 0.0:
            return 0.0
        errors = (0.0 if math.isnan(se) else se for se in (self.se, self.reference_se))
        return 100.0 * math.hypot(*errors) / abs(self.reference)

    @property
    def valid(self) -> bool:
        return not self.failure

    def line(self) -> str:
        """The point in one line."""
        outcome = self.failure or f"{self.value:.4g}, error {self.error_percent:.2g} %"
        return f"{self.case}: {self.method}, {self.setting}: {outcome}; {self.wall_s_per_simulated_s:.3g} s/s"


def front(points: Iterable[Point]) -> list[Point]:
    """Valid points of one case that no other valid point beats, in order of cost.

    A point beats another one that costs more by a factor of `ALIKE` and is not more accurate. It also beats one that
    costs the same within that factor and is less accurate by more than two standard errors.
    """
    valid = [point for point in points if point.valid]
    return sorted((p for p in valid if not any(_beats(q, p) for q in valid)), key=lambda p: p.wall_s_per_simulated_s)


def _beats(q: Point, p: Point) -> bool:
    """Whether q beats p; see `front`."""
    cheaper = q.wall_s_per_simulated_s * ALIKE < p.wall_s_per_simulated_s
    as_cheap = q.wall_s_per_simulated_s < p.wall_s_per_simulated_s * ALIKE
    noise = 2.0 * math.hypot(q.error_se_percent, p.error_se_percent)
    return (cheaper and q.error_percent <= p.error_percent) or (as_cheap and q.error_percent + noise < p.error_percent)


def is_default(point: Point) -> bool:
    """Whether the point has the method and the steps per period that the package uses by default for its case."""
    default = "one degree of freedom" if point.case == "bouncing_ball" else "impulses"
    return point.method == default and point.setting == DEFAULT_STEPS


def fastest_within(points: Iterable[Point], percent: float) -> Point | None:
    """The cheapest valid point with an error of at most `percent`, None without one.

    Of the points whose costs cannot be distinguished from the smallest it is the most accurate.
    """
    accurate = [point for point in points if point.valid and point.error_percent <= percent]
    least = min((point.wall_s_per_simulated_s for point in accurate), default=0.0)
    as_cheap = [point for point in accurate if point.wall_s_per_simulated_s <= ALIKE * least]
    return min(as_cheap, key=lambda point: point.error_percent, default=None)


def reference_of(case: Case, *, quick: bool, progress: Show = no_progress) -> tuple[float, float]:
    """Reference value of a case and its standard error: by a closed form, or by the finest run of the impulses.

    Args:
        case: to compute.
        quick: few seeds, and not quite as fine.
        progress: called with the fraction done.

    Raises:
        InputError: a seed of the finest run failed.
    """
    if case.exact is not None:
        return case.exact, 0.0
    finest, seeds = (QUICK_FINEST, case.quick_seeds[2]) if quick else (FINEST, case.seeds[2])
    point = _ensemble(case, METHODS[0], finest, seeds, progress)
    if point.failure:
        raise InputError(f"its reference failed: {point.failure}", key=case.name)
    return point.value, point.se


def measure(
    case: Case,
    method: Method,
    setting: int,
    reference: tuple[float, float],
    *,
    quick: bool,
    progress: Show = no_progress,
) -> Point:
    """Compute a case by a method at a setting.

    Args:
        case: to compute.
        method: to compute it by.
        setting: of the method.
        reference: value and standard error; see `reference_of`.
        quick: few seeds.
        progress: called with the fraction done.
    """
    if case.by_chance:
        point = _ensemble(case, method, setting, _seeds(case, method, quick=quick), progress)
    else:
        point = _once(case, method, setting)
    details = f"setting: {method.sweep}" + (f"; known to fail, {method.fails}" if method.fails else "")
    point = replace(point, reference=reference[0], reference_se=reference[1], details=details)
    if point.valid and not point.error_percent < LARGEST_PERCENT:
        instead = f" instead of {reference[0]:.3g}" if reference[0] else ""
        point = replace(point, failure=f"{case.quantity} {point.value:.3g}{instead}")
    return point


def _seeds(case: Case, method: Method, *, quick: bool) -> int:
    """Number of seeds of a case by chance."""
    seeds = (case.quick_seeds if quick else case.seeds)[int(method.slow)]
    return min(seeds, SEEDS_TO_FAIL) if method.fails else seeds


def costs_of(cases: Sequence[Case], methods: Sequence[Method], *, quick: bool) -> list[float]:
    """How long each piece of `measure_all` takes, about [s]: of a case the reference first, then the points."""
    return [cost for case in cases for cost in _costs_of(case, methods, quick=quick)]


def _costs_of(case: Case, methods: Sequence[Method], *, quick: bool) -> list[float]:
    points = [(method, setting) for method in methods for setting in method.settings_for(case, quick=quick)]
    if not case.by_chance:
        return [0.0, *(REPEAT_S for _ in points)]
    seeds = [(case.quick_seeds if quick else case.seeds)[2], *(_seeds(case, m, quick=quick) for m, _ in points)]
    slower = [1.0, *(method.slower(setting) for method, setting in points)]
    return [case.seed_s * n * factor for n, factor in zip(seeds, slower, strict=True)]


def measure_all(
    cases: Sequence[Case],
    methods: Sequence[Method],
    *,
    quick: bool,
    note: Callable[[str], None] = lambda _: None,
    progress: Show = no_progress,
) -> list[Point]:
    """Compute every case by every method at every setting.

    Args:
        cases: to compute.
        methods: to compute them by; each names the cases that it is used for.
        quick: few seeds and few settings.
        note: called with a line about each finished point.
        progress: called with the fraction done.
    """
    points = []
    pieces = iter(shares(progress, costs_of(cases, methods, quick=quick)))
    for case in cases:
        reference = reference_of(case, quick=quick, progress=next(pieces))
        for method in methods:
            for setting in method.settings_for(case, quick=quick):
                show = next(pieces)
                points.append(measure(case, method, setting, reference, quick=quick, progress=show))
                show(1.0)
                note(points[-1].line())
    return points


def scenario_of(case: Case, method: Method, setting: int, seeds: int = 1) -> Scenario:
    """The scenario of a case as a method computes it at a setting."""
    raw = case.scenario()
    raw["run"]["seeds"] = seeds
    return validated(method.apply(raw, setting), Scenario, Path(case.name))


def _once(case: Case, method: Method, setting: int) -> Point:
    """Compute a case without chance: only the engine, without recording; the shortest of a few runs is the cost."""
    prepared = prepare(scenario_of(case, method, setting))
    scene, engine_of = prepared.scene, engine_class(prepared.engine)
    engine_of(scene, np.random.default_rng(0)).advance(1)  # compiles the engine, which is not to be timed
    times: list[float] = []
    while not times or sum(times) < REPEAT_S:
        engine = engine_of(scene, np.random.default_rng(0))
        started = time.perf_counter()
        frames = engine.advance(scene.n_frames - 1)
        times.append(time.perf_counter() - started)
    finite = bool(np.isfinite(frames.position).all())
    value = case.observe(prepared, Seed(frames)) if finite else math.nan
    cost = min(times) / float(frames.time[-1])
    failure = "" if finite else "its state is not finite"
    return Point(case.name, method.name, setting, value, math.nan, 1, 0.0, 0.0, cost, failure)


def _ensemble(case: Case, method: Method, setting: int, seeds: int, progress: Show = no_progress) -> Point:
    """Compute a case by chance: mean and standard error over the seeds; a seed that does not end is a failure."""
    result = simulate(scenario_of(case, method, setting, seeds), progress=progress)
    simulated = sum(float(seed.frames.time[-1]) for seed in result.seeds)
    cost = sum(seed.wall_s for seed in result.seeds) / simulated
    values = [case.observe(result.prepared, seed) for seed in result.seeds if seed.status == Status.DONE]
    mean = Statistic.of(values)
    failure = ""
    if result.failures:
        failure = f"{len(result.failures)} of {seeds} seeds: {result.failures[0].cause}"
    elif mean.n < seeds:
        failure = f"{seeds - mean.n} of {seeds} seeds did not get there"
    return Point(case.name, method.name, setting, mean.mean, mean.se, mean.n, 0.0, 0.0, cost, failure)


def rows_of(points: Sequence[Point]) -> list[Row]:
    """Points as JSON takes them, with their errors, whether they are on the front, and whether the default."""
    on_front = {id(p) for case in {p.case for p in points} for p in front(q for q in points if q.case == case)}
    return finite_rows(
        asdict(p)
        | {
            "error_percent": p.error_percent,
            "error_se_percent": p.error_se_percent,
            "on_front": id(p) in on_front,
            "default": is_default(p),
        }
        for p in points
    )


def write_points(points: Sequence[Point], folder: Path) -> None:
    """Write points as CSV and as JSON; see `rows_of`."""
    write_rows(rows_of(points), folder, "methods")


PEER_COLUMNS = ("case", "method", "setting", "value", "se", "n", "wall_s_per_simulated_s", "failure", "details")


def read_peers(path: Path, references: dict[str, tuple[float, float]]) -> list[Point]:
    """Read points of other simulators.

    Args:
        path: CSV file with the columns `PEER_COLUMNS`.
        references: value and standard error by name of the case; rows of other cases are left out.

    Raises:
        InputError: a file that cannot be read, a missing column, a value that is no number.
    """
    points = []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            missing = [name for name in PEER_COLUMNS if name not in (reader.fieldnames or [])]
            if missing:
                raise InputError(f"has no column {missing[0]!r}, allowed is {', '.join(PEER_COLUMNS)}", file=path)
            for row in reader:
                if row["case"] in references:
                    points.append(_peer(row, references[row["case"]], path))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", file=path, key="--peers") from error
    return points


def _peer(row: dict[str, str], reference: tuple[float, float], path: Path) -> Point:
    """A row of the file as a point."""
    try:
        number = {
            name: float(row[name]) if row[name] else math.nan for name in ("value", "se", "wall_s_per_simulated_s")
        }
        setting, n = int(row["setting"]), int(row["n"] or 0)
    except (TypeError, ValueError) as error:
        raise InputError(f"{row['case']}, {row['method']}: {error}", file=path) from error
    failure = row["failure"] or ("" if math.isfinite(number["value"]) else "gave no number")
    return Point(
        case=row["case"],
        method=row["method"],
        setting=setting,
        value=number["value"],
        se=number["se"],
        n=n,
        reference=reference[0],
        reference_se=reference[1],
        wall_s_per_simulated_s=number["wall_s_per_simulated_s"],
        failure=failure,
        details=row["details"],
    )

"""An error budget of one measure: how far numerics, seeds, inputs, and what the model leaves out move it.

As ASME V&V 20 (2009): the uncertainty of a computed value is that of its numerics, its inputs and, where it is a mean
over seeds, its standard error, together as roots of sums of squares. What the model leaves out is no uncertainty but an
error: each effect that the package can take in or leave out is run with and without, from the same starts.

The folder holds budget.toml, scenario.toml and journals as that of a sweep, and

    budget.csv    a row per entry, see `Entry`
    budget.png    the entries as bars
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from feeder_sim.document.document import Table, Text
from feeder_sim.document.figure import Figure
from feeder_sim.errors import InputError
from feeder_sim.jobs.task import RepeatedWarning
from feeder_sim.measures.effort import Effort
from feeder_sim.measures.statistic import Statistic, finite_or_none
from feeder_sim.notebook import counted
from feeder_sim.plate.surface import POINTS_PER_WAVELENGTH
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Excitation, RigidPlate, Scenario, excitations_of
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.driven_mode import FOLLOWS
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Record, Study, csv_bytes
from feeder_sim.studies.sweep.cases import Case, Cases, CasesPlan, check_measure
from feeder_sim.studies.sweep.table import main_measure
from feeder_sim.studies.uncertainty.linear_shares import linear_shares
from feeder_sim.studies.uncertainty.spread import Draw, Spread, draws_of, spread_of

CSV, PICTURE = "budget.csv", "budget.png"
NUMERICS, SEEDS, INPUTS, MODEL = "numerics", "seeds", "inputs", "model"
PER_DRAW = 4  # times fewer seeds of a draw of the inputs than of an entry
Z90 = 1.645  # standard deviations to each side of a normal 90 % interval
SURE = 3.0  # standard errors: of several changes from the same mean one is often twice its error
ROLLING_UM, MUJOCO_STEPS = 1.0, 40
MORE = 10.0  # times smaller may a mode be that follows
OUTSIDE = "not in the model: air under flat faces (slows them as they land), adhesion, wear, and charge"


class BudgetQuestion(Question):
    """How far to trust a measure of a scenario."""

    kind = "budget"
    file = "budget.toml"
    base = "budgets"

    measure: Annotated[str | None, Field(strict=True, description="Measure to look at [the usual one].")] = None
    seeds: Annotated[int, Field(strict=True, ge=8, description="Seeds of every entry.")] = 32
    inputs: Annotated[int, Field(strict=True, ge=8, le=4096, description="Draws of [uncertain] inputs.")] = 32
    mujoco: Annotated[bool, Field(strict=True, description="Also MuJoCo in place of impulses, which is dear.")] = False

    @property
    def same(self) -> str:
        """Another measure or more seeds are no other question."""
        return f"{self.inputs} {self.mujoco}"

    def plan(self, scenario: Scenario, file: Path) -> CasesPlan:
        changes, left_out = _variants(scenario, self, file)
        draws = draws_of(scenario, self.inputs) if scenario.uncertain else []
        few = max(2, self.seeds // PER_DRAW)

        def varied(change: dict[str, Any]) -> Scenario:
            return scenario.changed({"uncertain": None, **change}, file=file)

        rows: list[tuple[Case, ...]] = [
            (Case(functools.partial(varied, change), {"entry": name}, times=math.ceil(self.seeds / few)),)
            for _, name, change in [("", "as it is", {}), *changes]
        ]
        points = [row[0].point for row in rows]
        if draws:
            rows.append(
                tuple(
                    Case(functools.partial(varied, draw), {**draw, "entry": INPUTS}, n, len(draws))
                    for n, draw in enumerate(draws)
                )
            )
            points.append({"entry": INPUTS})
        cases = Cases(tuple(points), tuple(rows), Effort(few, measure=self.measure or ""))
        kinds = tuple(kind for kind, _, _ in changes)

        def answer(cases: Cases, complete: bool, _: int) -> Budget:
            return Budget(self, scenario, kinds, tuple(draws), cases, complete, tuple(left_out))

        return CasesPlan(cases, answer)


def _variants(
    scenario: Scenario, question: BudgetQuestion, file: Path
) -> tuple[list[tuple[str, str, dict[str, Any]]], list[str]]:
    """What is changed, by kind and name; and what cannot be, a line each."""
    method, run = choose_engine(scenario).method, scenario.run
    variants: list[tuple[str, str, dict[str, Any]]] = []
    if method in ("exact", "joint"):
        variants.append((NUMERICS, "half the tolerance", {"run.tolerance_nm": 0.5 * scenario.tolerance}))
    elif method != "slide":
        variants.append((NUMERICS, "half the step", {"run.steps_per_period": 2 * run.steps}))
    if not isinstance(scenario.plate, RigidPlate):
        twice = 2 * (run.points_per_wavelength or POINTS_PER_WAVELENGTH)
        variants.append((NUMERICS, "table twice as fine", {"run.points_per_wavelength": twice}))
    voltages = [key for key, drive in excitations_of(scenario, Excitation) if drive.voltage_vpp is not None]
    if voltages:
        variants.append((NUMERICS, "more modes follow", {f"{key}.modes": FOLLOWS / MORE for key in voltages}))
        variants.append((MODEL, "no modes follow", {f"{key}.modes": "driven" for key in voltages}))
    toggles = (
        ("tangent_surface", "plane under the part" if not run.tangent_surface else "curved surface"),
        ("in_plane_velocity", "no in-plane motion" if run.in_plane_velocity else "in-plane motion"),
        ("reaction", "parts push the plate" if not run.reaction else "parts do not push the plate"),
    )
    variants += [(MODEL, name, {f"run.{key}": not getattr(run, key)}) for key, name in toggles]
    rolling = 0.0 if scenario.contact.rolling_friction_um else ROLLING_UM
    name = f"rolling friction of {rolling:g} um" if rolling else "no rolling friction"
    variants.append((MODEL, name, {"contact.rolling_friction_um": rolling}))
    other = "newton" if scenario.contact.law == "poisson" else "poisson"
    variants.append((MODEL, f"restitution by {other.title()}", {"contact.law": other}))
    if scenario.drive and all(drive.ring_up for drive in scenario.drive):
        changes = {f"drive[{i}].ring_up": False for i in range(len(scenario.drive))}
        variants.append((MODEL, "no ring-up", changes))
    if question.mujoco:
        mujoco = {"run.engine": "mujoco", "run.steps_per_period": MUJOCO_STEPS, "run.tolerance_nm": None}
        variants.append((MODEL, "MuJoCo in place of impulses", mujoco))
    allowed, left_out = [], []
    for kind, name, changed in variants:
        try:
            prepare(scenario.changed({"uncertain": None, **changed}, file=file))
        except InputError as error:
            left_out.append(f"{name}: {error.problem}")
        else:
            allowed.append((kind, name, changed))
    return allowed, left_out


@dataclass(frozen=True)
class Entry:
    """One line of a budget, in the unit of the measure.

    Attributes:
        kind: numerics, seeds, inputs or model.
        name: what is changed.
        change: of the mean; of seeds and inputs a standard deviation.
        se: standard error of the change.
        uncertainty: standard uncertainty that it adds; NaN for what the model leaves out.
    """

    kind: str
    name: str
    change: float
    se: float
    uncertainty: float

    def as_dict(self) -> dict[str, Any]:
        """By column; None where there is no value."""
        return {name: finite_or_none(v) if isinstance(v, float) else v for name, v in asdict(self).items()}


@dataclass(frozen=True, repr=False)
class Budget(Study):
    """How far to trust a measure.

    Attributes:
        question: what was asked.
        scenario: of which.
        kinds: of the variants, in the order of the points after the first.
        draws: of the uncertain inputs; none without any.
        cases: of the scenario as it is, of every variant, and of the draws.
        complete: whether all seeds are done.
        left_out: variants that the scenario cannot be computed with, a line each.
    """

    picture = PICTURE
    question: BudgetQuestion
    scenario: Scenario
    kinds: tuple[str, ...]
    draws: tuple[Draw, ...]
    cases: Cases
    complete: bool
    left_out: tuple[str, ...]

    @property
    def warnings(self) -> Sequence[RepeatedWarning]:
        return self.cases.warnings

    @property
    def failures(self) -> list[str]:
        return self.cases.failures

    @property
    def size(self) -> str:
        return f"{counted(len(self.cases.points), 'point')} of a budget"

    @cached_property
    def name(self) -> str:
        """Of the measure."""
        named = {name: 0.0 for case in self.cases for seed in case.done.values() for name in seed.values}
        check_measure(self.question.measure or "", named)
        return self.question.measure or main_measure(tuple(named), [row for rows in self.cases.rows for row in rows])

    def _values(self, case: Case) -> list[float]:
        return [seed.values.get(self.name, math.nan) for seed in case.seeds(self.cases.effort)]

    @cached_property
    def value(self) -> Statistic:
        """Of the scenario as it is."""
        return Statistic.of(self._values(self.cases.cases[0][0]))

    @cached_property
    def spread(self) -> Spread:
        """Over the uncertain inputs."""
        return spread_of([self._values(case) for case in self.cases.cases[-1]] if self.draws else [])

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All lines; none before all seeds are done."""
        if not self.complete:
            return ()
        usual = self._values(self.cases.cases[0][0])
        entries = [Entry(SEEDS, f"{self.value.n} of them", self.value.se, math.nan, self.value.se)]
        for kind, row in zip(self.kinds, self.cases.cases[1:], strict=False):
            values = self._values(row[0])
            change = Statistic.of(b - a for a, b in zip(usual, values, strict=False))
            # What seeds cannot tell from nothing adds nothing: their own scatter is in the entry of seeds.
            size = abs(change.mean) / math.sqrt(3.0) if abs(change.mean) > SURE * change.se else 0.0
            uncertainty = size if kind == NUMERICS else math.nan
            entries.append(Entry(kind, str(row[0].point["entry"]), change.mean, change.se, uncertainty))
        if self.draws:
            name = counted(len(self.scenario.uncertain or {}), "uncertain input")
            entries.append(Entry(INPUTS, name, self.spread.sd_inputs, math.nan, self.spread.sd_inputs))
        return tuple(entries)

    @property
    def uncertainty(self) -> float:
        """Standard uncertainty of the value."""
        return math.sqrt(sum(e.uncertainty**2 for e in self.entries if math.isfinite(e.uncertainty)))

    @property
    def largest(self) -> Entry:
        """The entry that adds most to the uncertainty."""
        return max(self.entries, key=lambda entry: entry.uncertainty if math.isfinite(entry.uncertainty) else -1.0)

    def verdict(self) -> str:
        """Value, its interval, and what would shrink it."""
        value, half, entry = self.value.mean, Z90 * self.uncertainty, self.largest
        text = f"{self.name} {value:.4g}, 90 % interval {value - half:.4g} to {value + half:.4g}"
        text += f"; largest: {entry.kind} ({entry.name})"
        if entry.kind == SEEDS:
            return f"{text}; more seeds shrink it"
        if entry.kind == NUMERICS:
            return f"{text}; a finer one shrinks it"
        values = [self._values(case) for case in self.cases.cases[-1]]
        joint = any(uncertain.joint for uncertain in (self.scenario.uncertain or {}).values())
        linear = None if joint else linear_shares(self.scenario, self.draws, values)
        if linear is None:
            return f"{text}; measure one of {', '.join(self.scenario.uncertain or ())}"
        first = max(linear.inputs, key=lambda share: share.share)
        return f"{text}; measure {first.key}"

    def measure(self, name: str | None = None) -> str:
        if name and name != self.name:
            raise InputError(f"is {name}, must be {self.name}: a budget is one of a measure", argument="measure")
        return self.name if self.complete else ""

    def table(self) -> list[Record]:
        return [entry.as_dict() for entry in self.entries]

    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        if not self.complete:
            return {"complete": False}
        half = Z90 * self.uncertainty
        return {
            "complete": True,
            "measure": self.measure(measure),
            "value": self.value.mean,
            "low": self.value.mean - half,
            "high": self.value.mean + half,
            "entries": self.table(),
            "left_out": list(self.left_out),
            "verdict": self.verdict(),
        }

    def lines(self, measure: str | None = None) -> list[str]:
        """The table and the verdict."""
        if not self.complete:
            return ["nothing is known before all seeds are done"]
        mean = abs(self.value.mean) or math.nan
        rows = []
        for entry in self.entries:
            error = f" +- {100.0 * entry.se / mean:.1f}" if math.isfinite(entry.se) else ""
            sign = "+" if entry.kind in (MODEL, NUMERICS) else ""
            percent = f"{100.0 * entry.change / mean:{sign}.1f}{error} %"
            rows.append((entry.kind, entry.name, f"{entry.change:{sign}.3g}", percent))
        return [
            *Table("", ("kind", "entry", "change", "of the value"), tuple(rows), numbers_from=2).lines(),
            self.verdict(),
        ]

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        yield from super().remarks(measure)
        for line in self.left_out:
            yield Text(f"left out: {line}")
        if not self.scenario.uncertain:
            yield Text("nothing is [uncertain]: inputs are taken to be known", "warning")
        yield Text(OUTSIDE, "note")

    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        if not self.complete:
            return {}
        return {CSV: csv_bytes(tuple(field.name for field in fields(Entry)), self.table())}

    def figures(self, measure: str) -> list[Figure]:
        from feeder_sim.plots.budget import budget_figure

        return [budget_figure(self)] if self.complete and self.value.mean else []

    def _line(self) -> str:
        return self.verdict() if self.complete else "Budget, not complete"

"""Where engines fail: stability maps whose cells are scenarios.

A nut starts half way between antinode and node of a standing wave, and its mean velocity over a short time is compared
with that of the impulses at the finest step.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from feeder_sim.errors import Divergence
from feeder_sim.measures.statistic import Statistic
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.studies.chart.cases import CONTACT, Raw, strip
from feeder_sim.studies.chart.map_cells import Axis, StabilityMap, State, Verdict, by_deviation
from feeder_sim.studies.chart.methods import Change, compliant, mujoco, steps
from feeder_sim.studies.chart.points import FINEST
from feeder_sim.studies.chart.shares import MUJOCO, MUJOCO_STEPS, SEED_S

EXPLODING_RISE = 5.0  # times the rise of the reference
LEAST_EXPLODING_RISE_MM = 2.0  # a smaller rise is never an explosion
NO_DRIFT_MM_S = 0.05  # a slower drift of the reference counts as none, since the nut hardly hops
DURATION_S = 0.5
SEEDS, MUJOCO_SEEDS, QUICK_SEEDS = 48, 6, 2
FAST, SLOW = 8775.0, 4750.0  # [Hz]
SLOW_HALF_WAY_MM = 9.7  # from the antinode at the lower frequency


@dataclass(frozen=True)
class EngineMap(StabilityMap):
    """A map of scenarios.

    Attributes:
        scenario: makes the scenario of a cell from its x and y.
        reference: makes the scenario with which it is compared; None where only tunnelling is of interest.
    """

    scenario: Callable[[float, float], Raw]
    reference: Callable[[float, float], Raw] | None

    def judge(self, x: float, y: float, *, quick: bool) -> Verdict:
        reference = None
        if self.reference is not None:
            reference = _reference(json.dumps(self.reference(x, y)), QUICK_SEEDS if quick else SEEDS)
        raw = self.scenario(x, y)
        return classify(_run(raw, self._seeds(raw, quick=quick)), reference)

    def cost(self, x: float, y: float, *, quick: bool) -> float:
        raw = self.scenario(x, y)
        run, seeds = raw["run"], self._seeds(raw, quick=quick)
        slower = MUJOCO * run["steps_per_period"] / MUJOCO_STEPS if _slow(raw) else 1.0
        return float(seeds * run["duration_s"] * SEED_S * slower)

    def _seeds(self, raw: Raw, *, quick: bool) -> int:
        """Number of seeds of a cell."""
        return QUICK_SEEDS if quick or self.reference is None else MUJOCO_SEEDS if _slow(raw) else SEEDS


def _slow(raw: Raw) -> bool:
    return bool(raw["run"]["engine"] == "mujoco")


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
    change(raw, int(setting))
    return raw


def _finest(raw: Raw) -> Raw:
    """The scenario of the reference: impulses at the finest step."""
    return made_by(steps, FINEST, raw)


def falling(speed: float, change: Change, steps_per_ms: int) -> Raw:
    """A nut that falls onto a plate of 3 mm at rest.

    Args:
        speed: of the nut at the start, 0.1 mm above the plate [m/s].
        change: the method.
        steps_per_ms: its solver steps per millisecond.
    """
    start = {"drop_height_mm": 0.1, "tilt_deg": 0.0, "velocity_mm_s": [0.0, 0.0, -1e3 * speed]}
    raw: Raw = {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": 1000.0, "amplitude_um": 0.0}],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": 0.1, "allow_unstable": True, "frames_per_second": 1000.0},
    }
    return made_by(change, steps_per_ms, raw)


def _soft(time_constant_ms: float) -> Change:
    """MuJoCo's compliant contact with a time constant that does not depend on the step."""

    def change(raw: Raw, setting: int) -> None:
        mujoco()(raw, setting)
        raw["contact"] |= {"model": "compliant", "time_constant_us": 1e3 * time_constant_ms}

    return change


STEPS = Axis("steps per period", (5, 10, 20, 40, 80), (10, 40))
RESTITUTION = Axis("restitution", (0.0, 0.1, 0.2, 0.4, 0.6), (0.2, 0.4))
FREQUENCY = Axis("frequency (Hz)", (2000, 4750, 8775, 12000), (4750,))
AMPLITUDE = Axis("amplitude (um)", (0.3, 1, 3, 10), (1, 10))
SPEED = Axis("speed of the impact (m/s)", (0.1, 0.3, 1, 3, 10), (1, 10))
ENGINE_MAPS = (
    EngineMap(
        "compliant",
        "MuJoCo, compliant contact, 8775 Hz",
        STEPS,
        Axis("time constant (steps)", (1, 2, 5, 10, 20), (1, 5)),
        lambda x, y: made_by(compliant(int(y), refsafe=False), x, half_way(FAST)),
        lambda x, y: _finest(half_way(FAST)),
    ),
    EngineMap(
        "mujoco",
        "MuJoCo, 8775 Hz",
        STEPS,
        RESTITUTION,
        lambda x, y: made_by(mujoco(), x, half_way(FAST, restitution=y)),
        lambda x, y: _finest(half_way(FAST, restitution=y)),
    ),
    EngineMap(
        "impulses",
        "impulses, 8775 Hz",
        STEPS,
        RESTITUTION,
        lambda x, y: made_by(steps, x, half_way(FAST, restitution=y)),
        lambda x, y: _finest(half_way(FAST, restitution=y)),
    ),
    EngineMap(
        "mujoco_drive",
        "MuJoCo, 40 steps per period",
        FREQUENCY,
        AMPLITUDE,
        lambda x, y: made_by(mujoco(), 40, half_way(x, y)),
        lambda x, y: _finest(half_way(x, y)),
    ),
    EngineMap(
        "impulses_drive",
        "impulses, 40 steps per period",
        FREQUENCY,
        AMPLITUDE,
        lambda x, y: made_by(steps, 40, half_way(x, y)),
        lambda x, y: _finest(half_way(x, y)),
    ),
    EngineMap(
        "falling",
        "MuJoCo, compliant contact with a plate of 3 mm",
        SPEED,
        Axis("time constant (ms)", (0.1, 0.3, 1, 3, 10), (0.3, 10)),
        lambda x, y: falling(x, _soft(y), max(20, math.ceil(20.0 / y))),
        None,
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
    return by_deviation(Statistic(relative, math.nan, se, drift["n"]), "drift")

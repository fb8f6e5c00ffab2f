"""Picks per minute of policies that run the same feeder: the fixed schedule, and a greedy one that looks.

    python docs/examples/greedy_picks.py --seeds 12 --map nut.npz
    python docs/examples/greedy_picks.py --parts 10 --seeds 2 --seconds 3

All start from the same parts (paired seeds), and end when a share of them is picked. Parts are picked by the same rule,
that of the scenario's schedule.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from prediction import GradientDrift, Prediction, add_map_options, prediction_of

import feeder_sim
from feeder_sim.errors import InputError
from feeder_sim.feeder.feeder import Feeder
from feeder_sim.measures.picking import nearest_neighbours
from feeder_sim.measures.statistic import Statistic
from feeder_sim.scenario import Excitation, Pick, Robot, Scenario, Stage

RESONANCES_HZ = (1420.0, 2646.0, 2797.0, 6199.0, 6788.0)  # of the 180 mm plate, whose gain was measured
VOLTAGE_VPP = 120.0
PULSES_S, REST_S = (0.1, 0.4), 0.4
SOFT = 2e-3  # [m]; what a prediction of the distance between two parts is worth
SHARE = 0.9  # of the parts, which a policy is to pick
SECONDS = 25.0  # on the clock at most, that of ten cycles of the source's schedule


@dataclass(frozen=True)
class Rate:
    """What a policy came to in every seed.

    Attributes:
        name: of the policy.
        picked, lost: parts, one entry per seed.
        minutes: on the clock, one entry per seed.
    """

    name: str
    picked: NDArray[np.int64]
    lost: NDArray[np.int64]
    minutes: NDArray[np.float64]

    @property
    def per_minute(self) -> NDArray[np.float64]:
        """Picks per minute of every seed."""
        return self.picked / self.minutes


@dataclass(frozen=True)
class Comparison:
    """Two policies on the same seeds; picks per minute of each, and of their difference."""

    rates: tuple[Rate, ...]

    def difference(self, one: int, other: int) -> Statistic:
        """Of the picks per minute of two policies, seed by seed."""
        return Statistic.of((self.rates[one].per_minute - self.rates[other].per_minute).tolist())


def pulses() -> list[Stage]:
    """The stages that the greedy policy chooses from."""
    return [
        Stage(
            name=f"{frequency:g} Hz, {pulse:g} s",
            drive=(Excitation(frequency_hz=frequency, voltage_vpp=VOLTAGE_VPP),),
            duration_s=pulse,
            pause_s=REST_S,
        )
        for frequency in RESONANCES_HZ
        for pulse in PULSES_S
    ]


class Policy(Protocol):
    """Says which stage comes next.

    Attributes:
        looks_after: numbers of the stages after which parts are picked.
    """

    @property
    def looks_after(self) -> Sequence[int]: ...

    def __call__(self, feeder: Feeder) -> Iterator[int]: ...


class FixedSchedule:
    """The schedule of a scenario, again and again, with its own picks."""

    def __init__(self, scenario: Scenario) -> None:
        assert scenario.schedule is not None
        self._order = scenario.schedule.order
        self.looks_after = [i for i, stage in enumerate(scenario.schedule.stage) if stage.picks]

    def __call__(self, feeder: Feeder) -> Iterator[int]:
        return itertools.cycle(self._order)


class InTurn:
    """Some stages in their order, without a look at the parts, and a pick after each."""

    def __init__(self, numbers: Sequence[int]) -> None:
        self.looks_after = numbers

    def __call__(self, feeder: Feeder) -> Iterator[int]:
        return itertools.cycle(self.looks_after)


class Greedy:
    """Of some stages the one after which most parts per second are predicted to have room, [m] of clearance.

    A stage that brought no pick is not tried again until another one did.
    """

    def __init__(self, numbers: Sequence[int], prediction: Prediction, clearance: float) -> None:
        self.looks_after, self._prediction, self._clearance = numbers, prediction, clearance

    def __call__(self, feeder: Feeder) -> Iterator[int]:
        in_vain: set[int] = set()
        while True:
            if len(in_vain) == len(self.looks_after):
                in_vain = set()
            left = [number for number in self.looks_after if number not in in_vain]
            places = feeder.poses().position[:, :2]
            best = left[int(np.argmax([self._worth(feeder.stages[n], n, places) for n in left]))]
            before = len(feeder.picked)
            yield best
            in_vain = in_vain | {best} if len(feeder.picked) == before else set()

    def _worth(self, stage: Stage, number: int, places: NDArray[np.float64]) -> float:
        """Parts per second that are to be picked after a stage."""
        room = promise(self._prediction.predict(number, places), self._clearance)
        return room / (stage.duration_s + stage.pause_s)


def promise(places: NDArray[np.float64], clearance: float) -> float:
    """About how many parts at predicted places (n, 2) [m] are farther than a clearance from all others."""
    return float((1.0 / (1.0 + np.exp(-(nearest_neighbours(places) - clearance) / SOFT))).sum())


def compare(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    share: float = SHARE,
    seconds: float = SECONDS,
    predictions: Mapping[str, Callable[[Feeder], Prediction]] | None = None,
    threads: int = 1,
    seen: Callable[[float], None] | None = None,
) -> Comparison:
    """Run the fixed schedule, the pulses in turn, and greedy policies, each on the same seeds.

    Args:
        scenario: has a schedule with a pick.
        seeds: of the starts.
        share: of the parts, after which a policy has picked enough.
        seconds: on the clock at most: simulated, and that of the scenario's robot and camera.
        predictions: makes one from a feeder, by the name of the greedy policy that chooses by it; `GradientDrift`,
            which needs no drift map, by default.
        threads: as for `Feeder`.
        seen: takes the share of the work that is done.

    Raises:
        InputError: the schedule has no pick with a clearance.
    """
    rules = scenario.schedule.picks if scenario.schedule else ()
    if not rules or rules[0][1].clearance_mm is None:
        raise InputError("has no pick with a clearance, which the loop is to make room for", key="schedule")
    rule = rules[0][1]
    first = Feeder(scenario, stages=pulses(), threads=threads)
    numbers = range(len(first.stage_names) - len(pulses()), len(first.stage_names))
    assert rule.clearance_mm is not None
    policies: dict[str, Policy] = {
        "fixed schedule": FixedSchedule(scenario),
        "pulses in turn": InTurn(numbers),
    }
    for name, made in (predictions or {"greedy": lambda feeder: GradientDrift(feeder.scene)}).items():
        policies[name] = Greedy(numbers, made(first), 1e-3 * rule.clearance_mm)
    ends: dict[str, list[tuple[int, int, float]]] = {name: [] for name in policies}
    done = 0
    for seed in seeds:
        for name, policy in policies.items():
            feeder = first.again(seed)
            clock = _run(feeder, policy, rule, math.ceil(share * scenario.n_parts), seconds)
            ends[name].append((len(feeder.picked), len(feeder.lost), clock / 60.0))
            done += 1
            if seen:
                seen(done / (len(policies) * len(seeds)))
    return Comparison(
        tuple(
            Rate(name, *(np.array(column) for column in zip(*of_seeds, strict=True))) for name, of_seeds in ends.items()
        )
    )


def _run(feeder: Feeder, policy: Policy, rule: Pick, enough: int, seconds: float) -> float:
    """Let a policy run a feeder until enough is picked, or time is over; returns the time on the clock [s]."""
    robot = feeder.scene.scenario.robot or Robot()
    clock, stages = 0.0, policy(feeder)
    while clock < seconds and len(feeder.picked) < enough and len(feeder.poses()):
        number = next(stages)
        begin, before = feeder.time, len(feeder.picked)
        feeder.vibrate(number)
        looks = number in policy.looks_after
        if looks and not feeder.stages[number].picks:
            feeder.pick_by(rule)
        clock += feeder.time - begin + robot.camera_s * looks + robot.pick_s * (len(feeder.picked) - before)
    return clock if len(feeder.picked) >= enough else max(clock, seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="separation_100", help="a name, or a file")
    parser.add_argument("--parts", type=int, help="in place of those of the scenario")
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--threads", type=int, default=1, help="of one seed; the result does not depend on them")
    parser.add_argument("--share", type=float, default=SHARE, help="of the parts, which each policy is to pick")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="on the clock at most")
    add_map_options(parser)
    options = parser.parse_args()
    scenario = feeder_sim.load_scenario(options.scenario)
    if options.parts:
        scenario = scenario.changed({"part[0].count": options.parts})
    name = "greedy by map" if options.map else "greedy by gradient"
    found = compare(
        scenario,
        range(options.seeds),
        predictions={name: lambda feeder: prediction_of(feeder.scene, options)},
        share=options.share,
        seconds=options.seconds,
        threads=options.threads,
    )
    for rate in found.rates:
        print(f"{rate.name:<18} {_text(Statistic.of(rate.per_minute.tolist()))} picks per minute, ", end="")
        print(f"{rate.picked.mean():.1f} picked and {rate.lost.mean():.1f} lost in {60.0 * rate.minutes.mean():.1f} s")
    for other in range(len(found.rates) - 1):
        print(f"{found.rates[-1].name} - {found.rates[other].name:<18} {_text(found.difference(-1, other))}")


def _text(value: Statistic) -> str:
    return f"{value.mean:.1f} +- {value.se:.1f} (SE, n = {value.n})"


if __name__ == "__main__":
    main()

"""The seeds of one run in an executor: the bits are those of threads, also in a folder; what is said when it breaks."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import strip_scenario

import feeder_sim
from feeder_sim.errors import FeederSimError
from feeder_sim.records.seed import Seed
from feeder_sim.scenario import Contact


class Elsewhere(ThreadPoolExecutor):
    """Threads that get and give back only what has been pickled, as other machines do."""

    def submit(self, fn: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        sent = pickle.dumps((fn, given, named))

        def call() -> Any:
            function, arguments, keywords = pickle.loads(sent)
            return pickle.loads(pickle.dumps(function(*arguments, **keywords)))

        return super().submit(call)


class Broken(ThreadPoolExecutor):
    def submit(self, fn: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        raise BrokenExecutor("a worker has ended")


def check_equal(one: tuple[Seed, ...], other: tuple[Seed, ...]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a.frames.position, b.frames.position) and a.status == b.status
        assert np.array_equal(a.impacts, b.impacts) and str(a.failure) == str(b.failure)


def test_seeds_elsewhere_are_those_of_threads() -> None:
    scenario = strip_scenario(seeds=3, duration_s=0.05)
    here = feeder_sim.simulate(scenario)
    with Elsewhere(2) as pool:
        there = feeder_sim.simulate(scenario, executor=pool)
    check_equal(here.seeds, there.seeds)
    assert here.measures() == there.measures()


def test_seeds_that_diverge_elsewhere_leave_their_last_states_in_the_folder(tmp_path: Path) -> None:
    step_us = 1e6 / (8775.0 * 40)  # springs so hard that the step is too long for them
    contact = Contact(model="compliant", time_constant_us=step_us, damping_ratio=0.1)
    scenario = strip_scenario(frequency_hz=8775.0, duration_s=1.0, seeds=2).model_copy(update={"contact": contact})
    here = feeder_sim.record_run(scenario, tmp_path / "here", replay=False)
    with Elsewhere(2) as pool:
        there = feeder_sim.record_run(scenario, tmp_path / "there", replay=False, executor=pool)
    assert len(there.failures) == 2
    check_equal(here.seeds, there.seeds)
    opened = feeder_sim.open(tmp_path / "there")
    check_equal(opened.seeds, there.seeds)
    assert sorted(p.name for p in tmp_path.glob("there/*")) == sorted(p.name for p in tmp_path.glob("here/*"))


def test_a_stopped_run_elsewhere_is_interrupted() -> None:
    stop = threading.Event()
    stop.set()
    with Elsewhere(1) as pool:
        assert feeder_sim.simulate(strip_scenario(seeds=3, duration_s=0.05), executor=pool, stop=stop).interrupted


def test_workers_that_end_are_told_in_one_line() -> None:
    with Broken(1) as pool, pytest.raises(FeederSimError, match="workers end before their seed has"):
        feeder_sim.simulate(strip_scenario(duration_s=0.05), executor=pool)


def test_what_cannot_be_had_elsewhere_is_refused_as_here() -> None:
    scenario = strip_scenario(duration_s=0.05).changed({"part[0].start.position_mm": [1e4, 0.0]})
    with Elsewhere(1) as pool, pytest.raises(feeder_sim.InputError, match="position_mm"):
        feeder_sim.simulate(scenario, executor=pool)


@pytest.mark.slow
def test_a_run_in_processes() -> None:
    scenario = strip_scenario(seeds=4, duration_s=0.05)
    with ProcessPoolExecutor(2) as pool:
        check_equal(feeder_sim.simulate(scenario).seeds, feeder_sim.simulate(scenario, executor=pool).seeds)

"""A single seed of a scenario by itself, as it is in the ensemble."""

from __future__ import annotations

import threading

import numpy as np

from feeder_sim.records.seed import Seed
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.scene.prepared import Prepared


def run_one_seed(prepared: Prepared, index: int) -> Seed:
    """Run one seed on one thread; the bits are those of the same seed of `simulate`."""
    sequence = np.random.SeedSequence(prepared.scenario.run.seed, spawn_key=(index,))  # as `spawn` gives it
    return SeedRun(prepared, index).run(np.random.default_rng(sequence), np.zeros(index + 1), threading.Event())

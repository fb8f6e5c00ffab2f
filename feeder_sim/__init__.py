"""Rigid parts on vibrating plates: from plate dimensions to transport speeds.

    scenario = feeder_sim.load_scenario("scenarios/drift_4750hz.toml")
    result = feeder_sim.simulate(scenario)
    print(result.measures()["transport_speed_mm_s"])

`record_run` also writes the run folder, `Scenario` and its tables build a scenario in code.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from feeder_sim.records.trajectory_file import read_recording as read_recording
    from feeder_sim.replay.replay import build_replay as build_replay
    from feeder_sim.run.batch import measure_drift as measure_drift
    from feeder_sim.run.prepare import prepare as prepare
    from feeder_sim.run.run_folder import record_run as record_run
    from feeder_sim.run.simulation import simulate as simulate
    from feeder_sim.scenario import Scenario as Scenario
    from feeder_sim.scenario import load_scenario as load_scenario
    from feeder_sim.scene.scene import build_scene as build_scene
    from feeder_sim.studies.sweep.sweep import sweep as sweep

_PUBLIC = {
    "Scenario": "scenario",
    "load_scenario": "scenario",
    "build_scene": "scene.scene",
    "prepare": "run.prepare",
    "simulate": "run.simulation",
    "measure_drift": "run.batch",
    "sweep": "studies.sweep.sweep",
    "record_run": "run.run_folder",
    "read_recording": "records.trajectory_file",
    "build_replay": "replay.replay",
}
__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    # Imported on first use, so that the command line can print its help without loading numba or MuJoCo.
    if name in _PUBLIC:
        return getattr(importlib.import_module(f"feeder_sim.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'feeder_sim' has no attribute '{name}'")

"""Rigid parts on vibrating plates: from plate dimensions to transport speeds.

    scenario = feeder_sim.load_scenario("scenarios/drift_4750hz.toml")
    result = feeder_sim.simulate(scenario, progress=True)
    print(result.drift.transport_speed_mm_s.mean)
    result.plot.drift()

Build scenarios in code from `Scenario` and its tables in `feeder_sim.scenario`; `scenario.changed` changes one.
`record_run` also writes a run folder, `record_tracks` one of what a camera has seen; `open` gives its result again, and
`document_of` a page of it. A result has findings, tables (`to_frame`, `to_xarray`) and plots; `record` of `simulate`
says what to keep of it: `AllFrames`, `EveryNth`, `ImpactsOnly`, `StatisticsOnly`. Questions about many runs are
`sweep`, `uncertainty`, `optimise`, `speed_map`, `chart`, `calibrate`, `budget` and `compare`; `measure_drift` runs many
drifts. A `Feeder` is run stage by stage, `FeederEnvironment` is one for Gymnasium (extra `gym`). Bad input is an
`InputError`.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from feeder_sim import scenario as scenario
    from feeder_sim.api.calls import compare as compare
    from feeder_sim.api.calls import measure_drift as measure_drift
    from feeder_sim.api.calls import record_run as record_run
    from feeder_sim.api.calls import record_tracks as record_tracks
    from feeder_sim.api.calls import simulate as simulate
    from feeder_sim.api.opened import open as open
    from feeder_sim.api.result import Result as Result
    from feeder_sim.api.studies import budget as budget
    from feeder_sim.api.studies import calibrate as calibrate
    from feeder_sim.api.studies import chart as chart
    from feeder_sim.api.studies import optimise as optimise
    from feeder_sim.api.studies import speed_map as speed_map
    from feeder_sim.api.studies import sweep as sweep
    from feeder_sim.api.studies import uncertainty as uncertainty
    from feeder_sim.errors import FeederSimError as FeederSimError
    from feeder_sim.errors import InputError as InputError
    from feeder_sim.feeder.environment import FeederEnvironment as FeederEnvironment
    from feeder_sim.feeder.feeder import Feeder as Feeder
    from feeder_sim.records.trajectory_file import read_recording as read_recording
    from feeder_sim.replay.replay import build_replay as build_replay
    from feeder_sim.report.document_of import document_of as document_of
    from feeder_sim.run.keep import AllFrames as AllFrames
    from feeder_sim.run.keep import EveryNth as EveryNth
    from feeder_sim.run.keep import ImpactsOnly as ImpactsOnly
    from feeder_sim.run.keep import StatisticsOnly as StatisticsOnly
    from feeder_sim.run.prepare import prepare as prepare
    from feeder_sim.scenario import Scenario as Scenario
    from feeder_sim.scenario import load_scenario as load_scenario
    from feeder_sim.scene.scene import build_scene as build_scene
    from feeder_sim.studies.ask import open_study as open_study

_PUBLIC = {
    "AllFrames": "run.keep",
    "EveryNth": "run.keep",
    "FeederSimError": "errors",
    "ImpactsOnly": "run.keep",
    "InputError": "errors",
    "Result": "api.result",
    "Scenario": "scenario",
    "Feeder": "feeder.feeder",
    "FeederEnvironment": "feeder.environment",
    "StatisticsOnly": "run.keep",
    "build_replay": "replay.replay",
    "build_scene": "scene.scene",
    "budget": "api.studies",
    "calibrate": "api.studies",
    "chart": "api.studies",
    "compare": "api.calls",
    "document_of": "report.document_of",
    "load_scenario": "scenario",
    "measure_drift": "api.calls",
    "open": "api.opened",
    "open_study": "studies.ask",
    "optimise": "api.studies",
    "prepare": "run.prepare",
    "read_recording": "records.trajectory_file",
    "record_run": "api.calls",
    "record_tracks": "api.calls",
    "simulate": "api.calls",
    "speed_map": "api.studies",
    "sweep": "api.studies",
    "uncertainty": "api.studies",
}
# `from feeder_sim import *` leaves Python's own `open` alone, and needs no extra.
__all__ = ["__version__", *(name for name in _PUBLIC if name not in ("open", "FeederEnvironment"))]


def __getattr__(name: str) -> Any:
    # Imported on first use, so that the command line can print its help without loading numba or MuJoCo.
    if name in _PUBLIC:
        return getattr(importlib.import_module(f"feeder_sim.{_PUBLIC[name]}"), name)
    if name == "scenario":
        return importlib.import_module("feeder_sim.scenario")
    raise AttributeError(f"module 'feeder_sim' has no attribute '{name}'")


def __dir__() -> list[str]:
    # Of the names that are listed, `help` asks for every one.
    missing = set() if importlib.util.find_spec("gymnasium") else {"FeederEnvironment"}
    return sorted({*__all__, *_PUBLIC, "scenario", "__doc__", "__file__", "__name__", "__path__"} - missing)

"""`feeder-sim drift-map`: the drift and diffusion of a part, tabulated once, to walk over plates in no time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from feeder_sim.cli.files import (
    AsJson,
    Dask,
    ScenarioFile,
    Seed,
    Set,
    ThreadCount,
    file_in_errors,
    scenario_of,
    writable,
)
from feeder_sim.cli.terminal import at_terminal, notify
from feeder_sim.errors import InputError, printable

SEEDS = 1000


def drift_map(
    scenario_file: ScenarioFile,
    out: Annotated[Path, typer.Option("--out", help="File to write (.npz).", show_default=False)],
    settings: Set = None,
    seeds: Annotated[int, typer.Option("--seeds", min=8, max=100_000, help="Runs for each entry of the map.")] = SEEDS,
    seed: Seed = None,
    workers: ThreadCount = None,
    dask: Dask = None,
    as_json: AsJson = False,
) -> None:
    """Tabulate drift and diffusion of the part of a scenario, for its contact and the thickness of its plate."""
    writable(out)
    if out.suffix != ".npz":
        raise InputError(f"is {out.suffix!r}, must be .npz", file=out, key="--out")
    scenario = scenario_of(scenario_file, None, None, seed, settings)
    with file_in_errors(scenario_file):
        from feeder_sim.pool.work import Work
        from feeder_sim.run.prepare import ignored_uncertainty
        from feeder_sim.studies.drift_map.files import save_map
        from feeder_sim.studies.drift_map.making import make_map, strip_of

        strip = strip_of(scenario)
        for warning in ignored_uncertainty(scenario):
            notify(f"warning: {warning}")
        with at_terminal(Work(workers), scenario_file.stem, dask) as work:
            new_map = make_map(scenario, strip, seeds=seeds, work=work)
        save_map(new_map, out)
    facts = {"file": str(out), "simulated_s": new_map.simulated_s, "processor_s": new_map.processor_s}
    if as_json:
        print(json.dumps(facts))
    else:
        cost = f"made of {new_map.simulated_s:.0f} simulated s in {new_map.processor_s:.0f} s of processor time"
        print(f"{printable(str(out))}: {cost}")

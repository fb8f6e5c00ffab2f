"""Options and arguments that several commands have, with the same name and the same meaning."""

from __future__ import annotations

from typing import Annotated

import typer

from feeder_sim.cli.files import OptionalScenarioFile as OptionalScenarioFile
from feeder_sim.cli.files import ScenarioFile as ScenarioFile

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
EngineName = Annotated[str | None, typer.Option("--engine", help="Engine instead of the scenario's.")]
Seeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Number of seeds instead of the scenario's.")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Root of the random numbers.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", help="KEY=VALUE in place of the scenario's, such as 'drive[0].amplitude_um=2'; repeatable."),
]
Measure = Annotated[str | None, typer.Option("--measure", help="Measure to print and draw [the usual one].")]
WorkerCount = Annotated[int | None, typer.Option("--workers", min=1, help="Processes [one per core].")]
ThreadCount = Annotated[int | None, typer.Option("--workers", min=1, help="Threads [one per core].")]
StallAfter = Annotated[
    float | None, typer.Option("--stall-after", help="Wall time in s after which a seed without a new frame ends [60].")
]
Dask = Annotated[str | None, typer.Option("--dask", help="Scheduler of a Dask cluster, such as tcp://host:8786.")]

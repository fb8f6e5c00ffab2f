"""What it changes, and what it costs, that parts act back on the plate: one nut, a hundred, and parts that ride it.

    python benchmarks/reaction.py

Every scenario runs with a prescribed plate and with `reaction = true`, one after the other on one core. The amplitude
is that of the driven mode with its reaction over that of the drive alone, looked at every 10 ms while the drive acts
and its ring-up is past the half; its fall is given as mean and as the largest of all looks. Energies are those that
parts take from the modes.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from feeder_sim.engines.impulse.reaction.engine import ReactingEngine
from feeder_sim.engines.impulse.scratch import FROM_MODES
from feeder_sim.engines.reaction import reaction_at
from feeder_sim.pool.work import Work
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario, with_run
from feeder_sim.scene.driven_mode import free_modes
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.start import generator

SCENARIOS = Path(__file__).parents[1] / "scenarios"
LOOK_S = 0.01
LOOKED_AT_S = 5.0  # of one seed, for what a single nut takes from the plate
RIDING_S = 1.5  # of parts that ride the plate, which takes long to compute
RUNG_UP = 0.5  # of the amplitude that the drive reaches


def main(
    seeds: Annotated[int, typer.Option(help="of one nut")] = 96,
    crowds: Annotated[int, typer.Option(help="seeds of a hundred nuts", min=2)] = 32,
    cycles: Annotated[int, typer.Option(help="of a hundred nuts")] = 1,
) -> None:
    nut = load_scenario(SCENARIOS / "drift_2797hz_plate.toml")
    print(f"{nut.title}, {seeds} seeds", flush=True)
    compare(with_run(nut, seeds=seeds))
    amplitudes(with_run(nut, seeds=1, stop="time", duration_s=LOOKED_AT_S))
    hundred = load_scenario(SCENARIOS / "separation_100.toml")
    assert hundred.schedule is not None
    schedule = hundred.schedule.model_copy(update={"cycles": cycles})
    hundred = with_run(hundred.model_copy(update={"schedule": schedule}), seeds=crowds)
    print(f"{hundred.title}: {cycles} of them, {crowds} seeds", flush=True)
    compare(hundred)
    amplitudes(with_run(hundred, seeds=2))
    for name in ("wave_circulation", "separation_heap"):
        riding = load_scenario(SCENARIOS / f"{name}.toml")
        print(f"{riding.title}: the first {RIDING_S:g} s")
        amplitudes(with_run(riding, seeds=1), until=RIDING_S)


def compare(scenario: Scenario) -> None:
    """Print the transport speed, or the counts after every stage, and the processor time, without and with reaction."""
    before = math.nan
    for reaction in (False, True):
        prepared = prepare(with_run(scenario, reaction=reaction))
        compile_engine(prepared)
        started = time.process_time()
        result = simulate(prepared, work=Work(1))
        simulated = sum(float(seed.frames.time[-1]) for seed in result.seeds)
        cost = 1e3 * (time.process_time() - started) / simulated
        found = result.measures()
        values = _of_stages(found["stages"]) if "stages" in found else {"mm/s": found["transport_speed_mm_s"]}
        said = ", ".join(f"{key} {value['mean']:.3f} +- {value['se']:.3f}" for key, value in values.items())
        print(
            f"  {'reaction' if reaction else 'prescribed':<12} {said}; {cost:.1f} ms per simulated second", flush=True
        )
        if reaction:
            print(f"  {'':<12} cost {cost / before:.2f} times; failures {len(result.failures)}")
        before = cost


def _of_stages(stages: list[dict[str, Any]]) -> dict[str, Any]:
    return {f"{name} {i + 1}": stage[name] for i, stage in enumerate(stages) for name in ("picked", "lost", "dead")}


def amplitudes(scenario: Scenario, until: float = math.inf) -> None:
    """Print what parts take from the plate up to a time [s], stage by stage, and how far the mode's amplitude falls."""
    prepared = prepare(with_run(scenario, reaction=True))
    stages = prepared.scene.times.stages
    fallen: list[list[float]] = [[] for _ in stages]
    taken = np.zeros((scenario.run.seeds, len(stages)))
    for seed in range(prepared.scenario.run.seeds):
        rng = generator(prepared.scene, seed)
        engine = ReactingEngine(prepared.scene, rng)
        energy = 0.0
        for number, stage in enumerate(stages):
            shapes = [prepared.scene.drives[i].shape for i in stage.excitations]
            while (now := float(engine.current().time[0])) + LOOK_S < min(stage.end, until):
                engine.advance(max(1, round(LOOK_S / prepared.scene.frame_interval)))
                if shapes and now + 2.0 * LOOK_S < stage.stop:
                    fallen[number].append(_fall(prepared, engine, shapes[0]))
            total = float(engine._account_opened[FROM_MODES])
            taken[seed, number], energy = total - energy, total
    for number, stage in enumerate(stages):
        fall = 100.0 * np.array([value for value in fallen[number] if math.isfinite(value)])
        if not len(fall):
            continue
        energy, duration = 1e3 * float(taken[:, number].mean()), min(stage.end, until) - stage.start
        name = stage.name or "all of it"
        print(f"  {name:<12} {energy:.3f} mJ taken from the modes of the plate in {duration:g} s, ", end="")
        print(f"amplitude lower by {fall.mean():.2f} % on average, by {fall.max():.2f} % at most", flush=True)


def _fall(prepared: Prepared, engine: ReactingEngine, shape: int) -> float:
    """By what share the amplitude of a mode is below that of its drive alone; NaN before that is half rung up."""
    surface, t = prepared.scene.surface, float(engine._span[0])
    drives = surface.terms.phasor(t, surface.n_shapes)[0, shape]
    full = max(drive.amplitude for drive in prepared.scene.drives if drive.shape == shape)
    if abs(drives) < RUNG_UP * full:
        return math.nan
    reaction = reaction_at(engine._reaction_opened, free_modes(prepared.scene.driven).rate, t)[shape]
    return float(1.0 - abs(drives + reaction) / abs(drives))


if __name__ == "__main__":
    typer.run(main)

"""Cost of this checkout beside that of another commit of this repository, side by side.

    python benchmarks/against.py COMMIT [--repeats 5] [--works drift_4750hz,crowd,...]

Runs every work with the package of this checkout and with that of COMMIT (in a work tree of its own) in turn, each time
in a process of its own, and prints medians and the median of the ratios. Machine code is compiled before the clock
starts. Leave the machine idle: the works take the cores they ask for.

drift_4750hz     processor time per simulated second of the whole scenario with its file: compiling and replay excepted
drift_8775hz     the same
crowd            wall time per simulated second of separation_100, two seeds on all cores; memory of that process
phases           processor time per simulated second in the stages of separation_100, one seed; the worst of them
crowds           processor time per simulated second of two cycles of separation_100, refill_nuts and brackets, 2 seeds
trays            the same of platform and rigid_plate
ensemble         64 seeds of drift_8775hz: share of all cores that is put to use
rest             processor time per simulated second of a cube that is dropped on a plate at rest
mujoco           processor time per simulated second of both drifts in the MuJoCo engine
start            wall time of commands on drift_4750hz, each in a process of its own; of `run` with all its 12 seeds
study            processor time of a sweep over drift_4750hz, each further seed
compilation      processor time of the first 0.02 s of a drift and of separation_100 in an empty cache; with
                 FEEDER_SIM_COMPILE=1 of compiling what the package brings, too
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Costs = dict[str, float]
ROOT = Path(__file__).resolve().parent.parent
STIFF = "youngs_modulus_gpa = 3.0, poisson_ratio = 0.3"
CUBE_MM, CUBE_KG = 104.8, 0.37  # of the tosses in ContactNets (Pfrommer, Halm and Posa, CoRL 2020)


def file_of(name: str) -> Path:
    """A scenario of the checkout that is measured, whose mode files it can read."""
    import feeder_sim

    return Path(feeder_sim.__file__).resolve().parents[1] / f"scenarios/{name}.toml"


def scenario_of(name: str, **run: Any) -> Any:
    """A scenario of the repository, with other values in its [run] table."""
    import feeder_sim

    scenario = feeder_sim.load_scenario(file_of(name))
    return scenario.model_copy(update={"run": scenario.run.model_copy(update=run)})


def simulated(result: Any) -> float:
    """Simulated time of all seeds [s]."""
    return sum(float(frames.time[-1]) for frames in result.trajectories)


def drift(name: str) -> Costs:
    import feeder_sim

    with tempfile.TemporaryDirectory() as folder:
        warm_up = scenario_of(name, duration_s=0.02, seeds=1)
        feeder_sim.record_run(warm_up, Path(folder) / "warm_up", replay=False)  # compiled and imported
        started = time.process_time()
        result = feeder_sim.record_run(scenario_of(name), Path(folder) / "run", replay=False)
        return {"cpu": (time.process_time() - started) / simulated(result)}


def separation(seeds: int, cycles: int) -> Any:
    scenario = scenario_of("separation_100", seeds=seeds)
    return scenario.model_copy(update={"schedule": scenario.schedule.model_copy(update={"cycles": cycles})})


def one_stage() -> Any:
    """The first 0.02 s of a cycle."""
    scenario = separation(1, 1)
    stage = scenario.schedule.stage[0].model_copy(update={"duration_s": 0.02})
    return scenario.model_copy(update={"schedule": scenario.schedule.model_copy(update={"stage": (stage,)})})


def compile_crowd() -> None:
    import feeder_sim

    feeder_sim.simulate(one_stage())


def crowd(cycles: int = 10) -> Costs:
    import feeder_sim

    compile_crowd()
    started = time.perf_counter()
    result = feeder_sim.simulate(separation(2, cycles))
    wall = (time.perf_counter() - started) / simulated(result)
    return {"wall": wall, "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0}


def crowds(
    names: Sequence[str] = ("separation_100", "refill_nuts", "brackets"), seeds: int = 2, cycles: int = 2
) -> Costs:
    import feeder_sim

    costs = {}
    for name in names:
        scenario = scenario_of(name, seeds=seeds)
        stage = scenario.schedule.stage[0].model_copy(update={"duration_s": 0.02})
        short = scenario.schedule.model_copy(update={"cycles": 1, "stage": (stage,)})
        feeder_sim.simulate(scenario.model_copy(update={"schedule": short}))
        scenario = scenario.model_copy(update={"schedule": scenario.schedule.model_copy(update={"cycles": cycles})})
        started = time.process_time()
        result = feeder_sim.simulate(scenario)
        costs[f"cpu {name}"] = (time.process_time() - started) / simulated(result)
    return costs


def trays() -> Costs:
    return crowds(("platform", "rigid_plate"))


def phases(cycles: int = 3) -> Costs:
    """The clock is read whenever the progress is."""
    import feeder_sim

    compile_crowd()
    scenario = separation(1, cycles)
    clock: list[tuple[float, float]] = [(0.0, time.process_time())]
    result = feeder_sim.simulate(scenario, progress=lambda share: clock.append((share, time.process_time())))
    clock.append((1.0, time.process_time()))
    total = simulated(result)
    costs: dict[str, float] = {"all": (clock[-1][1] - clock[0][1]) / total}
    begin = 0.0
    for cycle in range(cycles):
        for stage in scenario.schedule.stage:
            for part, length in ((stage.name, stage.duration_s), (f"{stage.name}, pause", stage.pause_s)):
                if length > 0.0:
                    costs[f"{part} {cycle + 1}"] = cpu_between(clock, begin / total, (begin + length) / total) / length
                    begin += length
    return costs | {"worst": max(costs.values())}


def cpu_between(clock: list[tuple[float, float]], first: float, last: float) -> float:
    """Processor time [s] between two shares of the progress."""
    import numpy as np

    share, seconds = np.array(clock).T
    order = np.argsort(share, kind="stable")
    return float(np.diff(np.interp([first, last], share[order], seconds[order]))[0])


def ensemble(seeds: int = 64) -> Costs:
    import feeder_sim

    feeder_sim.simulate(scenario_of("drift_8775hz", duration_s=0.02, seeds=1))
    scenario = scenario_of("drift_8775hz", seeds=seeds)
    cores = len(os.sched_getaffinity(0))
    started, used = time.perf_counter(), time.process_time()
    feeder_sim.simulate(scenario)
    return {"share": (time.process_time() - used) / (cores * (time.perf_counter() - started))}


def rest(duration: float = 2.0) -> Costs:
    import trimesh

    import feeder_sim

    with tempfile.TemporaryDirectory() as folder:
        trimesh.creation.box([CUBE_MM] * 3).export(Path(folder) / "cube.stl")
        text = f"""
            plate = {{ kind = "piston", length_mm = 1000.0, width_mm = 1000.0, thickness_mm = 10.0 }}
            drive = [{{ frequency_hz = 100.0, amplitude_um = 0.0 }}]
            contact = {{ restitution = 0.125, friction = 0.18 }}
            run = {{ seeds = 4, duration_s = {duration} }}
            [[part]]
            shape = "mesh"
            file = "cube.stl"
            material = {{ density_kg_m3 = {CUBE_KG / (1e-3 * CUBE_MM) ** 3}, {STIFF} }}
            start = {{ drop_height_mm = [50.0, 100.0], tilt_deg = [10.0, 40.0], yaw_deg = [0.0, 360.0] }}
        """
        (Path(folder) / "rest.toml").write_text("\n".join(line.strip() for line in text.splitlines()))
        scenario = feeder_sim.load_scenario(Path(folder) / "rest.toml")
        feeder_sim.simulate(scenario.model_copy(update={"run": scenario.run.model_copy(update={"duration_s": 0.1})}))
        started = time.process_time()
        result = feeder_sim.simulate(scenario)
        return {"cpu": (time.process_time() - started) / simulated(result)}


def mujoco() -> Costs:
    import feeder_sim

    costs = {}
    for name in ("drift_4750hz", "drift_8775hz"):
        scenario = scenario_of(name, engine="mujoco", seeds=2, duration_s=1.0, stop="time")
        feeder_sim.simulate(scenario.model_copy(update={"run": scenario.run.model_copy(update={"duration_s": 0.02})}))
        started = time.process_time()
        result = feeder_sim.simulate(scenario)
        costs[f"cpu {name}"] = (time.process_time() - started) / simulated(result)
    return costs


def start() -> Costs:
    file = str(file_of("drift_4750hz"))
    commands = {"version": ["--version"], "list": ["list"], "check": ["check", file], "run": ["run", file]}
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, words in commands.items():
            started = time.perf_counter()
            subprocess.run([sys.executable, "-m", "feeder_sim", *words], check=True, cwd=folder, capture_output=True)
            found[name] = time.perf_counter() - started
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import feeder_sim"], check=True)
        found["import"] = time.perf_counter() - started
    return found


def study(few: int = 8, many: int = 72) -> Costs:
    """A sweep of two points, with few and with many seeds."""
    spent = []
    for seeds in (few, many):
        with tempfile.TemporaryDirectory() as folder:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            words = ["sweep", str(file_of("drift_4750hz")), "--vary", "run.tolerance_nm=0.1,0.2", "--out", "s"]
            command = [sys.executable, "-m", "feeder_sim", *words, "--seeds", str(seeds)]
            subprocess.run(command, check=True, cwd=folder, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return {"cpu of a seed": (spent[1] - spent[0]) / (2 * (many - few))}


def compilation() -> Costs:
    """In a cache of its own; what the second scenario shares with the first is compiled once."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        import feeder_sim

        costs = {}
        drift, crowd = scenario_of("drift_8775hz", duration_s=0.02, seeds=1), one_stage()
        for name, scenario in (("drift", drift), ("crowd", crowd)):
            started = time.process_time()
            feeder_sim.simulate(scenario)
            costs[f"cpu {name}"] = time.process_time() - started
    return costs


def compile_all() -> Costs:
    """Leave machine code in the cache."""
    import feeder_sim

    feeder_sim.simulate(scenario_of("drift_8775hz", duration_s=0.02, seeds=1))
    compile_crowd()
    return {}


WORKS: dict[str, Callable[[], Costs]] = {
    "drift_4750hz": lambda: drift("drift_4750hz"),
    "drift_8775hz": lambda: drift("drift_8775hz"),
    "crowd": crowd,
    "crowds": crowds,
    "trays": trays,
    "phases": phases,
    "ensemble": ensemble,
    "rest": rest,
    "mujoco": mujoco,
    "start": start,
    "study": study,
    "compilation": compilation,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", help="to compare with")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--works", default=",".join(WORKS), help="names, with commas")
    parser.add_argument("--measure", help=argparse.SUPPRESS)  # what a process of its own does
    options = parser.parse_args()
    if options.measure:
        print(json.dumps((WORKS | {"compile": compile_all})[options.measure]()))
        return
    works = options.works.split(",")
    if unknown := set(works) - set(WORKS):
        parser.error(f"unknown works: {', '.join(sorted(unknown))}")
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git("worktree", "add", "--detach", str(tree), options.commit)
        try:
            for source in (tree, ROOT):  # beforehand, so that its memory does not count
                measured("compile", source, Path(folder))
            print(f"{'':32}{'before':>12}{'now':>12}{'ratio':>10}")
            for work in works:
                compare(work, tree, options.repeats, Path(folder))
        finally:
            git("worktree", "remove", "--force", str(tree))


def compare(work: str, tree: Path, repeats: int, folder: Path) -> None:
    """Measure a work on both sides in turn, and print its figures."""
    before, now = [], []
    for _ in range(repeats):
        before.append(measured(work, tree, folder))
        now.append(measured(work, ROOT, folder))
    for key in now[0]:
        ratios = [one[key] / other[key] for one, other in zip(before, now, strict=True)]
        values = [statistics.median(run[key] for run in side) for side in (before, now)]
        line = f"{f'{work}, {key}':32}{values[0]:12.4g}{values[1]:12.4g}{statistics.median(ratios):10.2f}"
        print(line, flush=True)


def measured(work: str, source: Path, folder: Path) -> Costs:
    """The figures of a work with the package in a folder, from outside of both trees."""
    environment = os.environ | {"PYTHONPATH": str(source)}
    command = [sys.executable, str(Path(__file__).resolve()), "-", "--measure", work]
    run = subprocess.run(command, check=True, cwd=folder, env=environment, capture_output=True, text=True)
    figures: dict[str, float] = json.loads(run.stdout.splitlines()[-1])
    return figures


def git(*arguments: str) -> None:
    subprocess.run(["git", "-C", str(ROOT), *arguments], check=True, capture_output=True)


if __name__ == "__main__":
    main()

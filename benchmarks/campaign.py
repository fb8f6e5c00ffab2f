"""Attacks on the command line, to be repeated with a seed of one's own; exits with 1 on any failure.

    python benchmarks/campaign.py --seed 1 --scenarios 10000 --files 1000 --kills 100 --disks 40 --pairs 40

scenarios   random ones, most of them wrong or absurd: each is refused in one line or prepared; one in 40 is run
files       damaged recordings, scenarios, mode files and meshes: refused in one line, or of no effect
kills       a run is killed or interrupted at random moments and resumed until it has ended: the same bits
disks       files may only get so large: one line, and after that the run goes on to the same bits
pairs       two processes in one folder at once: one of them records, the other one is refused

Whatever takes longer than a minute, prints a traceback, says more than one line or ends with an unknown exit code is a
failure. Its input is kept in the folder of --keep.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from feeder_sim.records.trajectory_file import read_recording

ROOT = Path(__file__).resolve().parent.parent
RUN_ONE_IN = 40  # scenarios
LIMIT_S = 60.0  # for a command; most take a second
# Takes one scenario file after the other from its input, and says what became of each.
PREPARE = """
import sys
import numpy as np
from pathlib import Path
from feeder_sim.errors import FeederSimError
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import load_scenario
from feeder_sim.scene.start import start_poses
for line in sys.stdin:
    try:
        start_poses(prepare(load_scenario(Path(line.strip()))).scene, np.random.default_rng(0))
        print("prepared", flush=True)
    except FeederSimError as error:
        plain = str(error).isprintable() and len(str(error)) < 600
        print(f"refused {error.exit_code}" if plain else "bad message", flush=True)
    except Exception as error:
        print(f"{type(error).__name__}: {error}".replace("\\n", " ")[:300], flush=True)
"""
SCENARIO = f"""
[plate]
kind = "piston"
length_mm = 120.0
width_mm = 120.0
[[drive]]
frequency_hz = 1000.0
amplitude_um = 20.0
[[part]]
shape = "mesh"
file = "{ROOT}/models/bracket/bracket.stl"
count = 6
start = {{ kind = "scattered", size_mm = [100.0, 100.0] }}
[run]
duration_s = 10.0
seeds = 3
frames_per_second = 500.0
"""
RECTANGLE = """
[plate]
kind = "modes"
mode_file = "modes.h5"
[[drive]]
frequency_hz = 2639.0
amplitude_um = 1.0
[[part]]
shape = "mesh"
file = "part.stl"
[run]
duration_s = 0.01
seeds = 1
"""


SPANS = {  # of keys, in powers of ten
    "frequency_hz": (0.5, 4.0),
    "amplitude_um": (-3.0, 1.5),
    "duration_s": (-1.5, 1.0),
    "d": (-0.5, 1.0),  # of parts and plates
    "h": (-0.5, 1.0),
    "t": (0.0, 0.9),
    "friction": (-2.0, 0.5),
    "restitution": (-2.0, 0.0),
    "damping": (-4.0, -1.0),
}


class Campaign:
    """Counts what became of every attack, and keeps what failed."""

    def __init__(self, keep: Path) -> None:
        self._keep, self._lock = keep, threading.Lock()
        self.counts: Counter[str] = Counter()
        self.failures: list[str] = []

    def note(self, outcome: str) -> None:
        with self._lock:
            self.counts[outcome] += 1

    def fail(self, what: str, *inputs: Path) -> None:
        with self._lock:
            self.counts["FAILED"] += 1
            self.failures.append(what)
            place = self._keep / f"{len(self.failures):03d}"
        place.mkdir(parents=True, exist_ok=True)
        (place / "what.txt").write_text(what)
        for path in inputs:
            copy = shutil.copytree if path.is_dir() else shutil.copy
            with contextlib.suppress(OSError):
                copy(path, place / path.name)


class Ended:
    """A command that has come to its end: exit code, and what it said."""

    def __init__(self, *arguments: object, file_size: int | None = None, signals: tuple[float, int] | None = None):
        command = [sys.executable, "-m", "feeder_sim", *map(str, arguments)]
        limit = None if file_size is None else lambda: _limit_files(file_size)
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace", preexec_fn=limit
        ) as process:
            if signals:
                after, number = signals
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(after)
                process.send_signal(number)
            try:
                self.out, self.err = process.communicate(timeout=LIMIT_S)
                self.code = process.returncode
            except subprocess.TimeoutExpired:
                process.kill()
                self.out, self.err = process.communicate()
                self.code = 999
        self.lines = [
            line for line in self.err.splitlines() if "compiling the engine" not in line and "warning" not in line
        ]

    def problem(self, allowed: tuple[int, ...]) -> str:
        """What is wrong with the way it ended; "" for nothing."""
        if self.code == 999:
            return "took too long"
        if self.code in (-signal.SIGINT, -signal.SIGTERM) and self.out:
            return ""  # it was asked to end when it had just done so
        if self.code not in allowed or "Traceback" in self.err:
            return f"exit code {self.code}: {self.err[-300:]}"
        if self.code in (1, 2) and len(self.lines) != 1:
            return f"{len(self.lines)} lines: {self.err[-300:]}"
        return ""


def _limit_files(size: int) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def frames_of(run: Path) -> list[bytes]:
    """All numbers that a run has recorded of its parts."""
    recording = read_recording(run)
    fields = ("time", "position", "quaternion", "velocity", "angular_velocity", "present")
    return [b"".join(getattr(seed, name).tobytes() for name in fields) for seed in recording.seeds]


def random_value(rng: random.Random, key: str) -> Any:
    """Something for a key: mostly a number that could be meant, at times anything at all."""
    if rng.random() < 0.02:
        odd: list[Any] = [0, -1, 1e300, float("nan"), float("inf"), "", "x\x1b[31m", [], {}, True, 10**30, [1, 2, 3]]
        odd += [rng.uniform(-1e6, 1e6), 1e-300, "a" * 3000, {"a": {"b": 1}}, [[[[1]]]]]
        return rng.choice(odd)
    typical = next((span for name, span in SPANS.items() if key.startswith(name)), (0.5, 2.0))
    low, high = typical if rng.random() < 0.97 else (-4.0, 7.0)
    return float(f"{10 ** rng.uniform(low, high):.3g}")


def random_scenario(rng: random.Random) -> dict[str, Any]:
    """Tables as a user might write them, with keys that are wrong, missing or too many."""

    def some(*keys: str, share: float = 0.5) -> dict[str, Any]:
        return {key: random_value(rng, key) for key in keys if rng.random() < share}

    def start() -> dict[str, Any]:
        kind = rng.choice(["point", "scattered", "heap"])
        at = {"position_mm": [rng.uniform(-5, 5), 0.0]} if rng.random() < 0.3 else {}
        heap = {"diameter_mm": random_value(rng, "diameter_mm")} if kind == "heap" else {}
        return (
            {"kind": kind}
            | heap
            | (at if kind == "point" else {})
            | some("drop_height_mm", "tilt_deg", "yaw_deg", share=0.2)
        )

    def excitation() -> dict[str, Any]:
        if "mode_file" in plate and rng.random() < 0.9:
            return resonance()
        keys = {key: random_value(rng, key) for key in ("frequency_hz", "amplitude_um")}
        return keys | some("phase_deg", "natural_frequency_hz", "damping_ratio", "mode", "voltage_vpp", share=0.02)

    def resonance() -> dict[str, Any]:
        """A drive of a plate in a mode file, by a voltage or an amplitude."""
        frequency = rng.choice([558.0, 597.2, 1420.0, 2646.0, 2797.0, 6788.0]) * rng.choice([1.0, 1.0, 1.001, 1.03])
        if rng.random() < 0.3:
            return {"frequency_hz": frequency, "amplitude_um": random_value(rng, "amplitude_um")}
        keys: dict[str, Any] = {"frequency_hz": frequency, "voltage_vpp": random_value(rng, "voltage_vpp")}
        names = ["centre", "back", "front", "beside"]
        keys |= {"actuator": rng.sample(names, rng.choice([1, 1, 2, 3]))} if rng.random() < 0.8 else {}
        keys |= {"actuator_phase_deg": [0.0, rng.uniform(-400, 400)]} if rng.random() < 0.2 else {}
        keys |= {"modes": rng.choice(["all", "driven", 0.01, 0.3, 2.0])} if rng.random() < 0.5 else {}
        return keys | some("natural_frequency_hz", "damping_ratio", "mode", "at_mm", share=0.03)

    plate: dict[str, Any] = rng.choice(
        [
            {"kind": "piston"} | some("length_mm", "width_mm", "thickness_mm", share=0.3),
            {"kind": "strip", "thickness_mm": random_value(rng, "t")} | some("length_mm", "width_mm", share=0.2),
            {"kind": "plate", "length_mm": 100.0, "width_mm": 80.0, "thickness_mm": random_value(rng, "t")},
            {"kind": "plate"} | some("length_mm", "width_mm", "thickness_mm", share=0.7),
        ][: rng.choice([2, 2, 2, 3, 4])]
    )
    if rng.random() < 0.25:
        model = rng.choice(["plate_180", "plate_180_piezos", "plate_180_piezos", "plate_hole"])
        plate = {"kind": "modes", "mode_file": str(ROOT / "models" / model / "modes.h5")} | some("rim", share=0.05)
    part: dict[str, Any] = rng.choice(
        [
            {"shape": "hex_nut", "size": rng.choice(["M2", "M2.5", "M3", "M5"] * 5 + ["M9"])},
            {"shape": "ball", "diameter_mm": random_value(rng, "d")},
            {"shape": "cylinder", "diameter_mm": random_value(rng, "d"), "height_mm": random_value(rng, "h")},
            {"shape": rng.choice(["mesh", "cube"]), "file": "none.stl"},
        ][: 4 if rng.random() < 0.1 else 3]
    )
    part |= {"start": start()} if rng.random() < 0.6 else {}
    several = part.get("start", {}).get("kind", "point") != "point"
    part |= {"count": rng.choice([1, 2, 7, 40, 5000])} if several or rng.random() < 0.05 else {}
    part |= (
        {"guide": {"kind": rng.choice(["slide", "tube"])} | some("tilt_deg", "friction")} if rng.random() < 0.1 else {}
    )
    raw: dict[str, Any] = {"plate": plate, "part": [part] * rng.choice([1, 1, 1, 2 if several else 1])}
    raw["run"] = {"duration_s": random_value(rng, "duration_s")} | some("frames_per_second", share=0.1)
    raw["run"] |= {"engine": rng.choice(["auto", "impulse", "mujoco"])} if rng.random() < 0.4 else {}
    raw["run"] |= {"reaction": True} if rng.random() < 0.2 else {}
    if rng.random() < 0.15:
        stage = {"duration_s": random_value(rng, "duration_s"), "drive": [excitation()]} | some("pause_s")
        raw["schedule"] = {"stage": [stage] * rng.choice([1, 2, 30]), "cycles": rng.choice([1, 3, 10_000])}
        if rng.random() < 0.9:
            del raw["run"]["duration_s"]
    else:
        raw["drive"] = [excitation() | some("start_s", share=0.1) for _ in range(rng.choice([1, 1, 2, 20]))]
    if rng.random() < 0.2:
        raw["contact"] = some("restitution", "friction")
        raw["contact"] |= {"model": "compliant"} if rng.random() < 0.3 else {}
    if rng.random() < 0.05:
        raw[rng.choice(["plates", "title", "goal", "mujoco", "run"])] = random_value(rng, "")
    return raw


def scenario_text(rng: random.Random) -> bytes:
    """A scenario file; a few are no TOML any more."""
    text = tomli_w.dumps(random_scenario(rng)).encode()
    if rng.random() < 0.1:
        at = rng.randrange(len(text))
        text = text[:at] + bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9))) + text[at + rng.randrange(9) :]
    return text


def attack_scenarios(campaign: Campaign, work: Path, rng: random.Random, count: int) -> None:
    """Prepare every scenario; run a few for a moment."""
    files = []
    for engine in ("impulse", "mujoco"):  # which compiles them
        (work / "warm.toml").write_text(SCENARIO.replace("[run]", f'[run]\nengine = "{engine}"'))
        subprocess.run(
            [sys.executable, "-m", "feeder_sim", "run", work / "warm.toml", "--seeds", "1", "--out", work / engine],
            check=True,
            capture_output=True,
        )
    for i in range(count):
        files.append(work / f"{i:05d}.toml")
        files[-1].write_bytes(scenario_text(rng))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        lanes = [
            pool.submit(prepare_all, campaign, files[k :: os.cpu_count() or 1]) for k in range(os.cpu_count() or 1)
        ]
        good = [file for lane in lanes for file in lane.result()]
        list(pool.map(lambda file: run_briefly(campaign, work, file), good[:: max(1, RUN_ONE_IN * len(good) // count)]))


def prepare_all(campaign: Campaign, files: list[Path]) -> list[Path]:
    """Prepare scenarios in a process of their own; returns those that can be run."""
    good = []
    waiting = list(reversed(files))
    while waiting:
        with subprocess.Popen(
            [sys.executable, "-c", PREPARE],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as process:
            assert process.stdin and process.stdout
            while waiting:
                file = waiting.pop()
                late = threading.Timer(LIMIT_S, process.kill)
                late.start()
                print(file, file=process.stdin, flush=True)
                said = process.stdout.readline().strip()
                late.cancel()
                if said == "prepared":
                    good.append(file)
                if said in ("prepared", "refused 2"):
                    campaign.note(f"scenario {said.split()[0]}")
                else:
                    campaign.fail(f"scenario: {said or 'the process died or took too long'}", file)
                if not said:
                    break
            process.stdin.close()
    return good


def run_briefly(campaign: Campaign, work: Path, file: Path) -> None:
    """Run a scenario, and interrupt it after some seconds: it has to end then."""
    run = work / file.stem
    ended = Ended("run", file, "--seeds", 1, "--out", run, signals=(4.0, signal.SIGINT))
    problem = ended.problem((0, 1, 2, 130))
    if problem:
        campaign.fail(f"run of a scenario: {problem}", file)
    else:
        campaign.note(f"run of a scenario, exit {ended.code}")
    shutil.rmtree(run, ignore_errors=True)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Flip bits, cut, insert or overwrite."""
    data = bytearray(content)
    kind = rng.randrange(4)
    at = rng.randrange(min(len(data), rng.choice([4096, len(data)])))
    if kind == 0:
        for _ in range(rng.choice([1, 1, 3])):
            data[rng.randrange(len(data)) if rng.random() < 0.5 else at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        data[at : at + 8] = bytes(rng.randrange(256) for _ in range(8))
    else:
        data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 50)))
    return bytes(data)


def attack_files(campaign: Campaign, work: Path, rng: random.Random, count: int) -> None:
    """Damage one file of a run that was killed, or one that a scenario reads; then use it."""
    (work / "scenario.toml").write_text(SCENARIO)
    whole, killed = work / "whole", work / "killed"
    problem = Ended("run", work / "scenario.toml", "--out", whole).problem((0,))
    after = 0.8
    while not list(killed.glob("seeds/*.h5")):
        shutil.rmtree(killed, ignore_errors=True)
        ended = Ended("run", work / "scenario.toml", "--out", killed, signals=(after, signal.SIGKILL))
        assert ended.code != 0, "the run ends before it can be killed: make it longer"
        after += 0.1
    (killed / ".lock").unlink(missing_ok=True)
    assert not problem, problem
    reference = frames_of(whole)
    inputs = work / "inputs"
    inputs.mkdir()
    (inputs / "scene.toml").write_text(RECTANGLE)
    shutil.copy(ROOT / "models/plate_180/modes.h5", inputs / "modes.h5")
    import trimesh

    trimesh.creation.box((4e0, 5e0, 3e0)).export(inputs / "part.stl")
    seeds = [rng.randrange(2**32) for _ in range(count)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda seed: attack_file(campaign, work, (killed, inputs, reference), seed), seeds))


def attack_file(campaign: Campaign, work: Path, held: tuple[Path, Path, list[bytes]], seed: int) -> None:
    killed, inputs, reference = held
    rng, place = random.Random(seed), work / f"damage_{seed}"
    if rng.random() < 0.7:
        shutil.copytree(killed, place)
        files = [*sorted(place.glob("seeds/*.h5")), place / "scene.h5", place / "scenario.toml"]
        files += sorted(place.glob("inputs/*"))
        file = rng.choice([files[0], *files])
        file.write_bytes(damaged(file.read_bytes(), rng))
        ended = Ended("resume", place)
        problem = ended.problem((0, 2))
        if not problem and ended.code == 0 and frames_of(place) != reference:
            problem = "went on to other numbers"
        kind = f"resume with a damaged {file.suffix[1:]}"
    else:
        shutil.copytree(inputs, place)
        file = place / rng.choice(["modes.h5", "part.stl", "scene.toml"])
        file.write_bytes(damaged(file.read_bytes(), rng))
        ended = Ended("run", place / "scene.toml", "--out", place / "run", signals=(20.0, signal.SIGINT))
        problem = ended.problem((0, 1, 2, 130))
        kind = f"run with a damaged {file.suffix[1:]}"
    if problem:
        campaign.fail(f"{kind}: {problem}", place)
    else:
        campaign.note(f"{kind}, exit {ended.code}")
    shutil.rmtree(place, ignore_errors=True)


def reference_run(work: Path) -> tuple[Path, list[bytes]]:
    """A scenario, and what its run records when nothing happens to it."""
    scenario = work / "scenario.toml"
    scenario.write_text(SCENARIO)
    ended = Ended("run", scenario, "--out", work / "whole")
    assert ended.code == 0, ended.err
    return scenario, frames_of(work / "whole")


def finish(run: Path, scenario: Path) -> Ended:
    """Go on with a run that was stopped in any way."""
    return Ended("resume", run) if (run / "run.json").exists() else Ended("run", scenario, "--out", run)


def conclude(campaign: Campaign, run: Path, problem: str, reference: list[bytes], well: str) -> None:
    """Compare a run that was attacked with one that was not, note how the attack went, and remove the run."""
    if not problem and frames_of(run) != reference:
        problem = "other numbers"
    if problem:
        campaign.fail(f"{well.split(':')[0]}: {problem}", run)
    else:
        campaign.note(well)
    shutil.rmtree(run, ignore_errors=True)


def attack_by_kills(campaign: Campaign, work: Path, rng: random.Random, count: int) -> None:
    scenario, reference = reference_run(work)

    def attack(seed: int) -> None:
        rng, run = random.Random(seed), work / f"run_{seed}"
        number = rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
        ended = Ended("run", scenario, "--out", run, signals=(rng.uniform(0.2, 4.0), number))
        for _ in range(rng.randrange(3)):
            if (run / "run.json").exists() and ended.code != 0:
                ended = Ended("resume", run, signals=(rng.uniform(0.2, 3.0), number))
        if ended.code != 0:
            ended = finish(run, scenario)
        problem = ended.problem((0, 2) if "has ended" in ended.err else (0,))
        conclude(campaign, run, problem, reference, f"{signal.Signals(number).name}: same bits")

    share_out(attack, rng, count)


def attack_by_disks(campaign: Campaign, work: Path, rng: random.Random, count: int) -> None:
    scenario, reference = reference_run(work)
    largest = max(path.stat().st_size for path in (work / "whole").iterdir())

    def attack(seed: int) -> None:
        rng, run = random.Random(seed), work / f"disk_{seed}"
        ended = Ended("run", scenario, "--out", run, file_size=int(10 ** rng.uniform(2.0, np.log10(1.2 * largest))))
        problem = ended.problem((0, 1))
        if not problem and ended.code == 1:
            ended = finish(run, scenario)
            problem = ended.problem((0, 2) if "has ended" in ended.err else (0,))
        conclude(campaign, run, problem, reference, "full disk: same bits")

    share_out(attack, rng, count)


def attack_by_pairs(campaign: Campaign, work: Path, rng: random.Random, count: int) -> None:
    scenario, reference = reference_run(work)

    def attack(seed: int) -> None:
        rng, run = random.Random(seed), work / f"pair_{seed}"
        commands: list[tuple[object, ...]] = [("run", scenario, "--out", run)] * 2
        if rng.random() < 0.5:
            Ended("run", scenario, "--out", run, signals=(rng.uniform(1.5, 2.5), signal.SIGKILL))
            if (run / "scenario.toml").exists():
                commands = [("resume", run)] * 2
        with ThreadPoolExecutor(2) as pool:
            both = list(pool.map(lambda command: Ended(*command), commands))
        problem = "".join(ended.problem((0, 2)) for ended in both)
        if not problem and sorted(ended.code for ended in both) not in ([0, 2], [2, 2]):
            problem = f"exit codes {[ended.code for ended in both]}"
        conclude(campaign, run, problem, reference, "pair: one recorded")

    share_out(attack, rng, count)


def share_out(attack: Callable[[int], None], rng: random.Random, count: int) -> None:
    """Make so many attacks, on all cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(attack, [rng.randrange(2**32) for _ in range(count)]))


ATTACKS = {
    "scenarios": (attack_scenarios, 10_000),
    "files": (attack_files, 1000),
    "kills": (attack_by_kills, 100),
    "disks": (attack_by_disks, 40),
    "pairs": (attack_by_pairs, 40),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("campaign_failures"), help="folder for what failed")
    for name, (_, count) in ATTACKS.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    chosen = parser.parse_args()
    failed = 0
    for name, (attack, _) in ATTACKS.items():
        count = getattr(chosen, name)
        if not count:
            continue
        campaign = Campaign(chosen.keep / name)
        with tempfile.TemporaryDirectory() as work:
            attack(campaign, Path(work), random.Random(f"{chosen.seed} {name}"), count)
        print(json.dumps({name: dict(sorted(campaign.counts.items()))}), flush=True)
        for what in campaign.failures:
            print(f"  FAILED {what}", flush=True)
        failed += len(campaign.failures)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()

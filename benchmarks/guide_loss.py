"""Energy that a cylinder loses to its guide per hop, at three frequencies, for guides that rub and lean.

    python benchmarks/guide_loss.py [--seeds 8] [--duration 6]

Each row changes the guide of scenarios/cylinder_558hz.toml, cylinder_2797hz.toml and cylinder_6199hz.toml only; all run
at the amplitude measured at 100 V peak to peak.

interval, height  the run's measures; `ballistic` is the interval that the departure velocity gives without a guide,
                  2 v / g, as a mean
loss              energy (of motion and height) between the first and the last frame of a flight, over the energy of
                  motion at its first frame: sum over the flights that count over sum. In free flight it is zero.
along z           the same of translation along z and height alone: what a vibrometer above sees. Motion along z can
                  become motion across or turning, and come back
hops              mean over flights of the loss of each, with the standard error of batch means
The source, D. Shi, EPFL thesis TH7124 (2016), says 9.74 % per hop; a line after each frequency interpolates the
friction of the upright guide that gives it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.bounces import LEAST_INTERVAL, batched, settling_time
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Seed
from feeder_sim.run.simulation import Result, simulate
from feeder_sim.scenario import Scenario, Tube, load_scenario, with_run

SCENARIOS = Path(__file__).parents[1] / "scenarios"
# frequency [Hz]: amplitude measured at 100 V peak to peak [um]; D. Shi, EPFL thesis TH7124 (2016)
MEASURED_UM = {558: 91.98, 2797: 19.70, 6199: 7.06}
SOURCE_LOSS = 9.74  # [%], the same
GUIDES: dict[str, dict[str, Any]] = {
    "free": {},
    "elastic wall": {"restitution": 1.0},
    "wall of restitution 0.8": {"restitution": 0.8},
    "friction 0.05": {"friction": 0.05},
    "friction 0.1": {"friction": 0.1},
    "friction 0.2": {"friction": 0.2},
    "friction 0.4": {"friction": 0.4},
    "leaning by 1 deg": {"tilt_deg": 1.0},
    "1 deg, friction 0.1": {"tilt_deg": 1.0, "friction": 0.1},
}
UPRIGHT = ("free", "friction 0.05", "friction 0.1", "friction 0.2", "friction 0.4")
LEAST_FRAMES = 4  # of a flight, for an energy at its begin and at its end


def variant(frequency: int, guide: dict[str, Any], **run: Any) -> Scenario:
    """The scenario of a frequency [Hz] at the measured amplitude, with some keys of its guide replaced."""
    base = load_scenario(SCENARIOS / f"cylinder_{frequency}hz.toml")
    part, drive = base.part[0], base.drive[0]
    assert part.guide is not None
    changes = {
        "drive": (drive.model_copy(update={"amplitude_um": MEASURED_UM[frequency]}),),
        "part": (part.model_copy(update={"guide": Tube(**(part.guide.model_dump() | guide))}),),
    }
    return with_run(base.model_copy(update=changes), **run)


def hop_energies(result: Result, seed: Seed) -> NDArray[np.float64]:
    """Of each flight: energy of motion at its first frame and loss until its last one, both along z too; (n, 4) [J]."""
    part, frames, impacts = result.scene.parts[0], seed.frames, seed.impacts
    attitude = Rotation.from_quat(frames.quaternion[:, 0], scalar_first=True)
    spin = attitude.inv().apply(frames.angular_velocity[:, 0])  # a cylinder is drawn in its principal axes
    kinetic, along_z = _kinetic(part.mass, part.inertia, frames.velocity[:, 0], spin)
    potential = part.mass * GRAVITY * frames.position[:, 0, 2]
    period = 1.0 / result.scene.scenario.drive[0].frequency_hz
    contacts = impacts[impacts.time >= settling_time(result.scene)]
    begins, ends = contacts.until[:-1], contacts.time[1:]
    counts = ends - begins >= LEAST_INTERVAL * period
    first = np.searchsorted(frames.time, begins[counts], side="right")
    last = np.searchsorted(frames.time, ends[counts], side="left") - 1
    long = last - first >= LEAST_FRAMES - 1
    first, last = first[long], last[long]
    total, vertical = kinetic + potential, along_z + potential
    lost, lost_along_z = total[first] - total[last], vertical[first] - vertical[last]
    return np.column_stack([kinetic[first], lost, along_z[first], lost_along_z])


def _kinetic(
    mass: float, inertia: NDArray[np.float64], velocity: NDArray[np.float64], spin: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Energy of motion (n,), and that of translation along z (n,) [J]; spin in the part's own axes."""
    turning = 0.5 * (spin**2 @ inertia)
    return 0.5 * mass * (velocity**2).sum(axis=1) + turning, 0.5 * mass * velocity[:, 2] ** 2


def ballistic_ms(seed: Seed, period: float, after: float) -> NDArray[np.float64]:
    """Interval [ms] of each flight that counts, from its departure velocity alone."""
    contacts = seed.impacts[seed.impacts.time >= after]
    counts = contacts.time[1:] - contacts.until[:-1] >= LEAST_INTERVAL * period
    return np.asarray(2e3 * contacts.departure_velocity[:-1][counts] / GRAVITY)


def main(
    seeds: Annotated[int, typer.Option()] = 8,
    duration: Annotated[float, typer.Option(help="[s]")] = 6.0,
) -> None:
    print("| f (Hz) | A (µm) | guide | interval (ms) | ballistic | height (mm) | loss (%) | along z (%) | hops (%) |")
    print("|---|---|---|---|---|---|---|---|---|")
    for frequency, amplitude in MEASURED_UM.items():
        whole: dict[float, float] = {}
        vertical: dict[float, float] = {}
        for name, guide in GUIDES.items():
            result = simulate(variant(frequency, guide, seeds=seeds, duration_s=duration), work=Work(1))
            measured, after = result.measures(), settling_time(result.scene)
            interval, height = measured["bounce_interval_ms"], measured["flight_height_mm"]
            each = [hop_energies(result, seed) for seed in result.seeds]
            begin, lost, begin_along_z, lost_along_z = np.concatenate(each).sum(axis=0)
            ballistic = np.concatenate([ballistic_ms(seed, 1.0 / frequency, after) for seed in result.seeds]).mean()
            hops = batched([100.0 * energies[:, 1] / energies[:, 0] for energies in each])
            loss, loss_along_z = 100.0 * lost / begin, 100.0 * lost_along_z / begin_along_z
            if name in UPRIGHT:
                whole[guide.get("friction", 0.0)], vertical[guide.get("friction", 0.0)] = loss, loss_along_z
            print(
                f"| {frequency} | {amplitude} | {name} | {interval['mean']:.2f} ± {interval['se']:.2f} "
                f"| {ballistic:.2f} | {height['mean']:.3f} ± {height['se']:.3f} | {loss:.2f} "
                f"| {loss_along_z:.2f} | {hops.mean:.2f} ± {hops.se:.2f} |",
                flush=True,
            )
        print(f"{frequency} Hz: {SOURCE_LOSS} % of all energy {friction_of(whole)}, along z {friction_of(vertical)}")


def friction_of(losses: dict[float, float]) -> str:
    """Friction at which losses [%] by rising friction first pass the source's."""
    frictions = list(losses)
    for below, above in pairwise(frictions):
        if losses[below] <= SOURCE_LOSS < losses[above]:
            share = (SOURCE_LOSS - losses[below]) / (losses[above] - losses[below])
            return f"at friction {below + share * (above - below):.3f}"
    return f"at no friction: {min(losses.values()):.1f} to {max(losses.values()):.1f} %"


if __name__ == "__main__":
    typer.run(main)

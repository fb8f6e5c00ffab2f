"""A cylinder on a standing wave, beside a published program: speeds at seven settings, by its rules and by the engine.

    python benchmarks/validation/bouncing_cylinder.py [--seeds 100] [--json] [--picture FILE]

Columns: what the program gave; its rules in a program of our own, with Poisson's restitution as it has and with
Newton's; the engine with the same rectangle in the same plane, by Newton's and by Poisson's; and a cylinder in space.
Then on a surface whose points move in the plane of the plate too, as those of a plate of 0.5 mm would: its rules, the
same with an impulse at each vertex in place of one at their mean, and the engine.

The program `vibrating-plate-simulator` (V. Sariola, 2016) goes with Zhou, Sariola, Latifi and Liimatainen, Nature
Communications 7 (2016) 12764: a rectangle of 600 x 300 um with the moment of inertia of a cylinder, on a wave of 6 mm
that moves up and down only, starts flat and at rest half way between antinode and node. Here it starts at places within
10 um of that. The speed is the slope of a straight line through the first 0.2 s of its way: so the published program
gives the speeds that it is known for.

Its rules are in vertex_impacts.py, apart from all engines. No plate bends in such waves. Here it is one of 0.5 mm, of a
material as soft as it takes; without in-plane velocity neither counts.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from arguments import new_file, whole
from numpy.typing import NDArray
from paths import follow
from scipy.spatial.transform import Rotation
from vertex_impacts import Body, Law, Times, Wave, bounce, mean_slope

from feeder_sim.document.figure import MM, MS, empty_figure
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.scenario import Contact, CustomMaterial, Cylinder, Drive, Run, Scenario, Start, Strip
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.single_thread import single_threaded

WAVELENGTH, DIAMETER, HEIGHT = 6e-3, 0.6e-3, 0.3e-3  # [m]
NODE = 0.25 * WAVELENGTH  # [m] from the antinode
START, SPREAD = 0.5 * NODE, 10e-6  # [m] from the antinode, and how far starts lie from it at most
DURATION, FRAMES = 0.2, 41  # [s] whose way counts; frames in it, with the one at the start
STEP = 1.0 / 64_000.0  # [s], of the program at any frequency
STEPS_PER_PERIOD = 64
THICKNESS, DENSITY, POISSON_RATIO = 0.5e-3, 2330.0, 0.3  # of the plate
TILT_DEG = 0.01  # at most, in any direction: so that nothing keeps a cylinder in the plane that it starts in
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """What the program was run with, and the speed that it gave; SI units.

    Attributes:
        amplitude: [m]. frequency: [Hz].
        speed: mean speed along x [m/s], negative toward the node.
    """

    amplitude: float = 2.5e-6
    frequency: float = 1000.0
    friction: float = 0.5
    restitution: float = 0.5
    speed: float = -1.51e-3

    @property
    def name(self) -> str:
        return f"{1e6 * self.amplitude:g} um, {self.frequency:g} Hz, mu {self.friction:g}, e {self.restitution:g}"


SETTINGS = (
    Setting(),
    Setting(amplitude=1e-6, speed=-0.34e-3),
    Setting(amplitude=5e-6, speed=-2.90e-3),
    Setting(amplitude=8e-6, speed=-3.56e-3),
    Setting(frequency=2200.0, speed=-3.38e-3),
    Setting(friction=0.2, speed=-1.56e-3),
    Setting(restitution=0.2, speed=-0.69e-3),
)
# Ways to compute a setting, and in words.
METHODS = {
    "rules": "its rules",
    "newton": "its rules, Newton's restitution",
    "engine": "engine, rectangle in the plane",
    "engine_poisson": "engine, Poisson's restitution",
    "cylinder": "engine, cylinder in space",
    "rules_in_plane": "its rules, with in-plane velocity",
    "vertices_in_plane": "its rules, vertex by vertex, with in-plane velocity",
    "engine_in_plane": "engine in the plane, with in-plane velocity",
    "cylinder_in_plane": "engine in space, with in-plane velocity",
}


@dataclass(frozen=True)
class Speeds:
    """Speeds of many starts of one setting by one method.

    Attributes:
        time: of frames (FRAMES,) [s].
        place: from the node along x (starts, FRAMES) [m], positive on the side of the antinode.
    """

    time: Floats
    place: Floats

    @property
    def speed_mm_s(self) -> Statistic:
        return Statistic.of((1e3 * mean_slope(self.time, self.place)).tolist())


@single_threaded
def compute(setting: Setting, method: str, starts: int = 100) -> Speeds:
    """Follow many starts of one setting by one of `METHODS`."""
    in_plane, distance = method.endswith("in_plane"), START + np.linspace(-SPREAD, SPREAD, starts)
    time = np.linspace(0.0, DURATION, FRAMES)
    if method.startswith(("rules", "newton", "vertices")):
        law = Law(setting.friction, setting.restitution, method != "newton", not method.startswith("vertices"))
        return Speeds(time, _by_its_rules(setting, law, NODE - distance, in_plane))
    name, planar = "poisson" if method.endswith("poisson") else "newton", method.startswith("engine")
    scene = build_scene(engine_scenario(setting, in_plane=in_plane, planar=planar, law=name))
    if method.startswith("engine"):
        scene = with_rectangle(scene)
    return Speeds(time, NODE - _by_engine(scene, distance, time))


def compare(starts: int = 100) -> Iterator[tuple[Setting, dict[str, Speeds]]]:
    """All settings by all methods."""
    for setting in SETTINGS:
        yield setting, {method: compute(setting, method, starts) for method in METHODS}


def _by_its_rules(setting: Setting, law: Law, starts: Floats, in_plane: bool) -> Floats:
    """Places (starts, FRAMES) [m] from the node, by its rules or others."""
    wave = standing_wave(_slab(setting.frequency), setting.frequency)
    lean = 0.5 * THICKNESS * wave.rotation if in_plane else 0.0
    per_frame = round(DURATION / (FRAMES - 1) / STEP)
    inertia = (0.75 * DIAMETER**2 + HEIGHT**2) / 12.0
    return np.asarray(
        bounce(
            Body(0.5 * DIAMETER, 0.5 * HEIGHT, inertia),
            Wave(setting.amplitude, 2.0 * math.pi / WAVELENGTH, 2.0 * math.pi * setting.frequency, lean),
            law,
            Times(STEP, per_frame, FRAMES),
            starts,
        )
    )


def engine_scenario(setting: Setting, *, in_plane: bool, planar: bool, law: str = "newton") -> Scenario:
    """The setting as a scenario, for one seed."""
    slab = _slab(setting.frequency).material
    material = CustomMaterial(
        density_kg_m3=slab.density, youngs_modulus_gpa=1e-9 * slab.youngs_modulus, poisson_ratio=slab.poisson_ratio
    )
    start = Start(position_mm=(1e3 * START, 0.0), drop_height_mm=(0.0, 0.0), yaw_deg=(0.0, 0.0), tilt_deg=(0.0, 0.0))
    return Scenario(
        plate=Strip(thickness_mm=1e3 * THICKNESS, material=material),
        drive=(Drive(frequency_hz=setting.frequency, amplitude_um=1e6 * setting.amplitude, ring_up=False),),
        part=(Cylinder(shape="cylinder", diameter_mm=1e3 * DIAMETER, height_mm=1e3 * HEIGHT, start=start),),
        contact=Contact(law=law, restitution=setting.restitution, friction=setting.friction),
        run=Run(
            engine="impulse",
            duration_s=DURATION,
            seeds=1,
            steps_per_period=STEPS_PER_PERIOD,
            in_plane_velocity=in_plane,
            planar=planar,
        ),
    )


def _slab(frequency: float) -> RectangularPlate:
    """A plate whose waves are as long as they have to be.

    Both stiffnesses, D = E d and S = E s, are proportional to Young's modulus E, so that the dispersion relation of
    feeder_sim.plate.rectangle is quadratic in E; its larger root is bending.
    """
    omega2, k2 = (2.0 * math.pi * frequency) ** 2, (2.0 * math.pi / WAVELENGTH) ** 2
    unit = RectangularPlate(1.0, 1.0, THICKNESS, Material(DENSITY, 1.0, POISSON_RATIO))
    d, s, m, j = unit.bending_stiffness, unit.shear_stiffness, unit.mass_per_area, unit.rotary_inertia
    a, b, c = s * d * k2**2, (s * k2 * j + m * (d * k2 + s)) * omega2, m * j * omega2**2
    modulus = (b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    return replace(unit, material=replace(unit.material, youngs_modulus=modulus))


def with_rectangle(scene: Scene) -> Scene:
    """The scene with the four corners of the cylinder's outline only.

    The outline of a cylinder in a plane has the points of its rims between them too. They are no corners of it, and on
    a wave they touch at the same time as others, more often the longer the step.
    """
    (kind,) = scene.kinds
    kind = replace(kind, corners=0.5 * np.array([[x * DIAMETER, 0.0, z * HEIGHT] for x in (-1, 1) for z in (-1, 1)]))
    return replace(scene, kinds=(kind,), parts=(replace(kind, name=scene.parts[0].name),))


def _by_engine(scene: Scene, distance: Floats, time: Floats) -> Floats:
    """Places (starts, times) [m] along x, of a part that starts flat on the plate at `distance` (starts,) [m]."""
    turn = np.zeros((len(distance), 3))
    lift = np.zeros(len(distance))
    if not scene.scenario.run.planar:
        random = np.random.default_rng(0)
        tilt, way = np.radians(random.uniform(0.0, TILT_DEG, len(turn))), random.uniform(0.0, 2.0 * math.pi, len(turn))
        turn[:, 0], turn[:, 1] = tilt * np.cos(way), tilt * np.sin(way)
        lift = 0.5 * DIAMETER * np.sin(tilt)
    places = np.stack([distance, np.zeros_like(distance), 0.5 * HEIGHT + lift], axis=1)
    return follow(scene, places, Rotation.from_rotvec(turn), time)[0][:, :, 0]


STYLES = {  # colour and marker
    "rules": ("black", "s"),
    "newton": ("#8a8a8a", "v"),
    "engine": ("#3a60be", "o"),
    "engine_poisson": ("#3a60be", "x"),
    "cylinder": ("#7fa6e0", "D"),
    "rules_in_plane": ("#be3434", "s"),
    "vertices_in_plane": ("#d98080", "v"),
    "engine_in_plane": ("#e08a1e", "o"),
    "cylinder_in_plane": ("#f2c078", "D"),
}
SHOWN = ("rules", "engine", "rules_in_plane", "engine_in_plane")  # ways


def draw_bouncing_cylinder(found: Sequence[tuple[Setting, dict[str, Speeds]]], path: Path) -> None:
    """Draw the mean way at the first setting with its standard deviation, and the speeds at all settings."""
    figure = empty_figure(10.5, 4.8)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.75])
    setting, speeds = found[0]
    for method in SHOWN:
        way, time = speeds[method].place * MM, speeds[method].time * MS
        mean, spread, colour = way.mean(axis=0), way.std(axis=0), STYLES[method][0]
        left.plot(time, mean, color=colour, label=METHODS[method])
        left.fill_between(time, mean - spread, mean + spread, color=colour, alpha=0.15, linewidth=0)
    left.axhline(0.0, color="0.6", linewidth=0.8)
    left.text(time[-1], 0.01, "node", fontsize=8, color="0.4", ha="right", va="bottom")
    left.set(xlabel="time (ms)", ylabel="from the node (mm)", xlim=(0.0, time[-1]))
    left.set_title(setting.name, fontsize=9)
    left.legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 0.06))
    rows = np.arange(len(found))
    for i, (method, (colour, marker)) in enumerate(STYLES.items()):
        statistics = [each[method].speed_mm_s for _, each in found]
        at = rows + 0.09 * (i - 4.0)
        mean, se = [s.mean for s in statistics], [s.se for s in statistics]
        right.errorbar(mean, at, xerr=se, fmt=marker, color=colour, markersize=4, label=METHODS[method])
    for row, (each, _) in zip(rows, found, strict=True):
        label = "published program" if row == 0 else None
        right.plot([each.speed * MM] * 2, [row - 0.42, row + 0.42], color="#3a8a5a", linewidth=2.0, label=label)
    right.set_yticks(rows, [each.name for each, _ in found], fontsize=8)
    right.invert_yaxis()
    right.set(xlabel="speed (mm/s), negative toward the node")
    right.grid(True, axis="x", alpha=0.3)
    figure.legend(*right.get_legend_handles_labels(), fontsize=7, loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=150)


HEADS = {
    "rules": "its rules",
    "newton": "Newton",
    "engine": "engine",
    "engine_poisson": "engine, Poisson",
    "cylinder": "in space",
    "rules_in_plane": "its rules, i.p.",
    "vertices_in_plane": "vertices, i.p.",
    "engine_in_plane": "engine, i.p.",
    "cylinder_in_plane": "in space, i.p.",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(1, 10_000), default=100, help="starts, within 10 um of each other")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--picture", type=new_file)
    options = parser.parse_args()
    found, rows = [], []
    if not options.json:
        heads = "  ".join(f"{HEADS[method]:>15}" for method in METHODS)
        print(f"speeds in mm/s; i.p.: with in-plane velocity\n{'setting':<32}  program  {heads}")
    for setting, speeds in compare(options.seeds):
        found.append((setting, speeds))
        means = {method: each.speed_mm_s for method, each in speeds.items()}
        rows.append(
            {"setting": setting.name, "published_mm_s": 1e3 * setting.speed}
            | {method: mean.as_dict() for method, mean in means.items()}
        )
        if not options.json:
            columns = "  ".join(f"{m.mean:7.2f} +- {m.se:.2f}".rjust(15) for m in means.values())
            print(f"{setting.name:<32}  {1e3 * setting.speed:7.2f}  {columns}", flush=True)
    if options.json:
        print(json.dumps(rows, indent=1))
    if options.picture:
        draw_bouncing_cylinder(found, options.picture)


if __name__ == "__main__":
    main()

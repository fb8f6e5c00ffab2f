"""A free ball on a swinging piston in the engine, beside the one-dimensional reference of small_noise_slide.py."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from small_noise_slide import Heights, mean_height

from feeder_sim.engines.protocol import engine_class
from feeder_sim.scenario import Ball, Contact, Drive, RigidPlate, Run, Scenario, Start
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import build_scene
from feeder_sim.scene.start import generator

RADIUS = 1.5e-3  # [m]
# Frames a second over the frequency: no whole ratio, so that frames see the piston at 40 phases.
FRAMES_PER_PERIOD = 40.0 / 21.0
NOISES = (1e-8, 1e-9, 3e-8, 1e-7)  # [m/s] of an impact, of the references; the first is the engine's
FLOOR = 2e-3  # relative, of standard errors: where the ball locks onto a period there is no spread


@dataclass(frozen=True)
class Case:
    """Frequency [Hz], amplitude [m] and restitution."""

    frequency: float
    amplitude: float
    restitution: float

    def __str__(self) -> str:
        return f"{self.frequency:g} Hz, {1e6 * self.amplitude:.3g} um, e {self.restitution:g}"


def scenario(case: Case, duration: float, seeds: int) -> Scenario:
    """Drops of about 50 um onto a piston that swings from the begin."""
    start = Start(drop_height_mm=(0.03, 0.07), tilt_deg=(0.0, 0.0))
    drive = Drive(frequency_hz=case.frequency, amplitude_um=1e6 * case.amplitude, ring_up=False)
    return Scenario(
        plate=RigidPlate(kind="piston"),
        drive=(drive,),
        part=(Ball(shape="ball", diameter_mm=2e3 * RADIUS, start=start),),
        contact=Contact(restitution=case.restitution),
        run=Run(
            duration_s=duration,
            seeds=seeds,
            frames_per_second=case.frequency * FRAMES_PER_PERIOD,
        ),
    )


@dataclass(frozen=True)
class Compared:
    """Mean heights in the engine and of the reference, and processor time of the engine per simulated second.

    others: of the reference with other traces of noise, whose size nobody knows.
    """

    engine: Heights
    reference: Heights
    others: tuple[Heights, ...]
    cost: float

    @property
    def deviation(self) -> float:
        return self.engine.mean / self.reference.mean - 1.0

    @property
    def in_errors(self) -> float:
        """How far outside of all references, in standard errors of both together; they differ by more than that."""
        references = sorted((self.reference, *self.others), key=lambda one: one.mean)
        low, high, mean = references[0], references[-1], self.engine.mean
        if low.mean <= mean <= high.mean:
            return 0.0
        nearest = low if mean < low.mean else high
        return (mean - nearest.mean) / math.hypot(nearest.error, self.engine.error, FLOOR * mean)


def engine_heights(case: Case, *, duration: float, seeds: int) -> tuple[Heights, float]:
    """Mean heights after a tenth of the time [m], and processor time per simulated second."""
    asked = scenario(case, duration, seeds)
    scene, means, spent = build_scene(asked), [], 0.0
    for rng in (generator(scene, seed) for seed in range(scene.scenario.run.seeds)):
        engine = engine_class(choose_engine(asked))(scene, rng)
        began, left, skip, total = time.process_time(), scene.n_frames - 1, scene.n_frames // 10, 0.0
        engine.advance(skip)
        left -= skip
        counted = left
        while left > 0:
            block = min(left, 20_000)
            total += float((engine.advance(block).position[:, 0, 2] - RADIUS).sum())
            left -= block
        means.append(total / counted)
        spent += time.process_time() - began
    return Heights(np.array(means)), spent / (duration * seeds)


def compared(case: Case, *, duration: float = 10.0, seeds: int = 8) -> Compared:
    """Engine and references, these over four times as long."""
    heights, cost = engine_heights(case, duration=duration, seeds=seeds)
    reference, *others = (
        mean_height(
            case.frequency, case.amplitude, case.restitution, duration=4.0 * duration, seeds=max(8, seeds), noise=noise
        )
        for noise in NOISES
    )
    return Compared(heights, reference, tuple(others), cost)

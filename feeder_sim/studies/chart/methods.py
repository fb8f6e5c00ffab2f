"""Methods of the chart: ways of computing a case, each with the settings along its curve.

A method only changes the scenario of a case, so that a scenario file can ask for everything that is compared here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from feeder_sim.studies.chart.cases import Case, Raw
from feeder_sim.studies.chart.shares import MUJOCO, MUJOCO_STEPS

Change = Callable[[Raw, int], None]

DEFAULT_STEPS = 40  # per period
SHORTEST_CONTACT = 5  # steps per time constant of a compliant contact
FAILURE_S = 6.0  # simulated time within which a method that is known to fail does so
BALL, DROPS, DRIFTS, CROWD, TRANSPORT, NOTE = (
    ("bouncing_ball",),
    ("flat_drop", "sliding_impact"),
    ("drift_4750", "drift_8775"),
    ("crowd_20",),
    ("transport_strip",),
    ("chladni_plate",),
)
SHORT = (*BALL, *DROPS, *DRIFTS, *CROWD, *NOTE)  # what a method that is a hundred times as slow computes in minutes
EVERYTHING = (*SHORT, *TRANSPORT)


@dataclass(frozen=True)
class Method:
    """A method, which makes one curve of the chart.

    Attributes:
        name: in the legend.
        change: turns the scenario of a case into that of the method, at a setting.
        settings: along the curve; their meaning is `sweep`.
        cases: names of the cases that it computes.
        quick: settings in the quick variant of the chart.
        costly: settings for cases by chance, whose many seeds take long; `settings` where empty.
        sweep: meaning of the settings.
        slow: whether it gets the smaller number of seeds.
        fails: why it is known to compute something else than the case; empty if it is not.
    """

    name: str
    change: Change
    settings: tuple[int, ...]
    cases: tuple[str, ...] = EVERYTHING
    quick: tuple[int, ...] = ()
    costly: tuple[int, ...] = ()
    sweep: str = "steps per period"
    slow: bool = True
    fails: str = ""

    def settings_for(self, case: Case, *, quick: bool) -> tuple[int, ...]:
        """Settings at which a case is computed; none where the method is not used for it."""
        if case.name not in self.cases:
            return ()
        if quick:  # leaves out failures that take long
            return () if self.fails and case.by_chance else self.quick
        return self.costly or self.settings if case.by_chance else self.settings

    def slower(self, setting: int) -> float:
        """How many times as long as by impulses a seed takes, about."""
        steps_per_period = setting if self.sweep == Method.sweep else DEFAULT_STEPS
        return MUJOCO * steps_per_period / MUJOCO_STEPS if self.slow else 1.0

    def apply(self, raw: Raw, setting: int) -> Raw:
        """Change the scenario of a case in place to that of the method, and return it."""
        self.change(raw, setting)
        if self.fails:
            raw["run"] |= {"allow_unstable": True, "duration_s": min(raw["run"]["duration_s"], FAILURE_S)}
        return raw


def steps(raw: Raw, setting: int) -> None:
    """Impulses with default settings; `setting` is the number of steps per period."""
    raw["run"] |= {"steps_per_period": setting, "engine": "impulse"}
    if setting < 20:
        raw["run"]["allow_unstable"] = True


def impulses(**run: bool) -> Change:
    """Impulses with other values in the table [run]."""

    def change(raw: Raw, setting: int) -> None:
        steps(raw, setting)
        raw["run"] |= run

    return change


def mujoco(**settings: object) -> Change:
    """MuJoCo with values in the table [mujoco] that differ from the defaults of the package."""

    def change(raw: Raw, setting: int) -> None:
        raw["run"] |= {"steps_per_period": setting, "engine": "mujoco"}
        raw["mujoco"] = dict(settings)

    return change


def compliant(steps_per_constant: int, **settings: object) -> Change:
    """MuJoCo's spring-damper contact with a time constant of a number of steps."""

    def change(raw: Raw, setting: int) -> None:
        mujoco(**settings)(raw, setting)
        frequency = max(drive["frequency_hz"] for drive in drives_of(raw))
        compliance = {
            "model": "compliant",
            "time_constant_us": steps_per_constant * 1e6 / (frequency * setting) * (1 + 1e-9),
        }
        raw["contact"] |= compliance

    return change


def iterations(raw: Raw, setting: int) -> None:
    """MuJoCo's solver, stopped after `setting` iterations."""
    mujoco(iterations=setting)(raw, DEFAULT_STEPS)


def on_slide(raw: Raw, setting: int) -> None:
    """A part on a slide, which can only move up and down, and whose events the slide method finds exactly."""
    steps(raw, setting)
    raw["part"][0]["guide"] = {"kind": "slide"}


def drives_of(raw: Raw) -> list[Raw]:
    """All drives of a scenario, with or without a schedule."""
    stages = raw.get("schedule", {}).get("stage", [])
    return [*raw.get("drive", []), *(drive for stage in stages for drive in stage["drive"])]


COARSE_TO_FINE = (20, 40, 80)
METHODS = (
    Method("impulses", steps, (10, 20, 40, 80, 160), quick=(20, 40), costly=(10, 20, 40, 80), slow=False),
    Method("impulses, tangent plane", impulses(tangent_surface=True), COARSE_TO_FINE, DRIFTS, (40,), slow=False),
    Method(
        "impulses, no in-plane velocity",
        impulses(in_plane_velocity=False),
        (40,),
        DRIFTS,
        (40,),
        slow=False,
    ),
    Method("one degree of freedom", on_slide, (40,), BALL, (40,), slow=False),
    Method("MuJoCo", mujoco(), (20, 40, 80, 160), SHORT, quick=(40,), costly=COARSE_TO_FINE),
    Method("MuJoCo", mujoco(), (40,), TRANSPORT),
    Method("MuJoCo, compliant contact", compliant(SHORTEST_CONTACT), (40, 80, 160), SHORT, (), (40,)),
    Method("MuJoCo, pyramidal cone", mujoco(cone="pyramidal"), (40, 80), (*DROPS, "drift_8775"), costly=(40,)),
    Method("MuJoCo, contact of hulls", mujoco(contact_set="hull"), (40, 80), (*DROPS, "drift_8775"), costly=(40,)),
    Method("MuJoCo, few iterations", iterations, (1, 3), (*DROPS, "drift_4750"), costly=(1,), sweep="iterations"),
    Method(
        "MuJoCo, mocap plate",
        mujoco(plate="mocap"),
        (40,),
        (*BALL, "drift_8775"),
        quick=(40,),
        fails="a mocap body has no velocity in contact",
    ),
    Method(
        "MuJoCo, discrete integrator",
        mujoco(integrator="discrete"),
        (40,),
        (*BALL, *DROPS, "drift_8775"),
        quick=(40,),
        fails="it takes the rebound out",
    ),
    Method(
        "MuJoCo, contact of one step",
        compliant(1, refsafe=False),
        (40,),
        (*DROPS, "drift_8775"),
        quick=(40,),
        fails="a contact shorter than five steps throws parts",
    ),
)

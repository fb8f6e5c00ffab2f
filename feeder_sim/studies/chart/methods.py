"""Methods of the chart: ways of computing a case, each with the settings that make its curve.

A method changes the scenario of a case and nothing else, so that everything here can be asked for in a scenario file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from feeder_sim.studies.chart.cases import Case, Raw

Change = Callable[[Raw, int], None]

DEFAULT_STEPS = 40
SHORTEST_CONTACT = 5  # steps per time constant
LONG_ENOUGH_S = 6.0  # to see that a method fails
BALL, DROPS, DRIFTS, CROWD = (
    ("bouncing_ball",),
    ("flat_drop", "sliding_impact"),
    ("drift_4750", "drift_8775"),
    ("crowd_20",),
)
EVERYTHING = (*BALL, *DROPS, *DRIFTS, *CROWD)


@dataclass(frozen=True)
class Method:
    """One curve.

    Attributes:
        name: in the legend.
        change: turns the scenario of a case into that of the method, at a setting.
        settings: along the curve, steps per period unless `sweep` says otherwise.
        costly: the same for cases of chance, whose many seeds take long; as `settings` where empty.
        cases: names of the cases it is tried on.
        quick: settings of the quick variant.
        sweep: what the settings are.
        slow: gets the smaller number of seeds.
        fails: why it is known not to simulate what was asked for.
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
        """Settings tried on a case; none where the method is not for it."""
        if case.name not in self.cases:
            return ()
        if quick:  # slow failures are for the full chart
            return () if self.fails and case.by_chance else self.quick
        return self.costly or self.settings if case.by_chance else self.settings

    def apply(self, raw: Raw, setting: int) -> Raw:
        """Change the scenario of a case, in place; returns it."""
        self.change(raw, setting)
        if self.fails:
            raw["run"] |= {"allow_unstable": True, "duration_s": min(raw["run"]["duration_s"], LONG_ENOUGH_S)}
        return raw


def steps(raw: Raw, setting: int) -> None:
    """Impulses, by default, at this many steps per period."""
    raw["run"] |= {"steps_per_period": setting, "engine": "impulse"}
    if setting < 20:
        raw["run"]["allow_unstable"] = True


def impulses(**run: bool) -> Change:
    """Impulses with a simplification."""

    def change(raw: Raw, setting: int) -> None:
        steps(raw, setting)
        raw["run"] |= run

    return change


def mujoco(**settings: object) -> Change:
    """MuJoCo with other settings than the package's."""

    def change(raw: Raw, setting: int) -> None:
        raw["run"] |= {"steps_per_period": setting, "engine": "mujoco"}
        raw["mujoco"] = dict(settings)

    return change


def compliant(steps_per_constant: int, **settings: object) -> Change:
    """MuJoCo's spring-damper contact, as stiff as so many steps per time constant allow."""

    def change(raw: Raw, setting: int) -> None:
        mujoco(**settings)(raw, setting)
        frequency = max(drive["frequency_hz"] for drive in drives_of(raw))
        law = {"model": "compliant", "time_constant_us": steps_per_constant * 1e6 / (frequency * setting) * (1 + 1e-9)}
        raw["contact"] |= law

    return change


def iterations(raw: Raw, setting: int) -> None:
    """MuJoCo's solver, stopped after so many iterations."""
    mujoco(iterations=setting)(raw, DEFAULT_STEPS)


def on_slide(raw: Raw, setting: int) -> None:
    """A ball that can only move up and down, whose events the slide engine finds exactly."""
    steps(raw, setting)
    raw["part"][0]["guide"] = {"kind": "slide"}


def drives_of(raw: Raw) -> list[Raw]:
    """All drives of a scenario."""
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
    Method("MuJoCo", mujoco(), (20, 40, 80, 160), quick=(40,), costly=COARSE_TO_FINE),
    Method("MuJoCo, compliant contact", compliant(SHORTEST_CONTACT), (40, 80, 160), EVERYTHING, (), (40,)),
    Method("MuJoCo, pyramidal cone", mujoco(cone="pyramidal"), (40, 80), (*DROPS, "drift_8775"), costly=(40,)),
    Method("MuJoCo, contact of hulls", mujoco(contact_set="hull"), (40, 80), (*DROPS, "drift_8775"), costly=(40,)),
    Method("MuJoCo, few iterations", iterations, (1, 3), (*DROPS, "drift_4750"), costly=(1,), sweep="iterations"),
    Method("MuJoCo, mm-g-ms", mujoco(units="mm-g-ms"), (40,), DROPS),
    Method(
        "MuJoCo, mm-g-ms, its own tolerance",
        mujoco(units="mm-g-ms", tolerance="default"),
        (40,),
        (*DROPS, "drift_4750"),
    ),
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

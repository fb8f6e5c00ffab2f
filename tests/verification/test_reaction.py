"""What parts do to the plate: each impulse acts on the driven modes, and no energy comes from nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, struck
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim import simulate
from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.contact_problem import Modes
from feeder_sim.engines.impulse.reaction.engine import ReactingEngine
from feeder_sim.engines.impulse.scratch import BY_CORRECTION, BY_IMPACTS, FROM_MODES
from feeder_sim.engines.reaction import reaction_at
from feeder_sim.records.seed import Status
from feeder_sim.scenario import HexNut, Scenario
from feeder_sim.scene.driven_mode import free_modes
from feeder_sim.scene.part import build_part
from feeder_sim.scene.scene import build_scene

PLATE = {"kind": "modes", "mode_file": REPOSITORY / "models" / "plate_180" / "modes.h5"}
NUT = {"shape": "hex_nut", "size": "M2.5"}
BALL = {"shape": "ball", "diameter_mm": 8.0}
EXACT = 1e-6  # of the energy that the modes have got; what is left is round-off
MANY = (
    439.0,
    556.0,
    1418.0,
    1543.0,
    2646.0,
    3398.0,
    3596.0,
    3772.0,
)  # [Hz]; with the driven one more than a body has motions


def on_plate(
    *parts: dict[str, Any], amplitude_um: float = 0.0, at_rest: Any = (2646.0,), contact: Any = None, **run: Any
) -> Scenario:
    """Parts on the 180 mm plate with modes that rest [Hz], and one that may be driven."""
    drive = [{"frequency_hz": f, "amplitude_um": a} for f, a in (*((f, 0.0) for f in at_rest), (2797.0, amplitude_um))]
    raw = {"plate": PLATE, "drive": drive, "part": parts, "contact": contact or {}}
    return Scenario.model_validate(raw | {"run": {"duration_s": 0.2, "seeds": 1, "reaction": True} | run})


def at(x_mm: float, y_mm: float = 0.0, **start: Any) -> dict[str, Any]:
    return {"start": {"position_mm": [x_mm, y_mm], "drop_height_mm": [1.0, 1.0], "tilt_deg": [5.0, 5.0]} | start}


class Undamped:
    """An engine over modes without damping, and the energies [J] in it at the begin of its window."""

    def __init__(self, scenario: Scenario) -> None:
        self.scene = build_scene(scenario)
        self.engine, self.modes = ReactingEngine(self.scene, np.random.default_rng(0)), free_modes(self.scene.driven)
        self.engine._surface.rate.real[-len(self.modes.rate) :] = 0.0
        self.engine._window = 1e-3  # at whose begins its state is

    def of_parts(self) -> float:
        state, total = self.engine._opened, 0.0
        for i, kind in enumerate(self.scene.kind_of):
            part, turned = self.scene.kinds[kind], state["attitude"][i]
            inverse = turned @ np.diag(1 / part.inertia) @ turned.T
            total += 0.5 * part.mass * state["velocity"][i] @ state["velocity"][i]
            total += 0.5 * state["momentum"][i] @ inverse @ state["momentum"][i]
            total += part.mass * GRAVITY * state["position"][i, 2]
        return total

    def of_modes(self) -> float:
        z = self.engine._reaction_opened
        squared = (self.modes.rate.imag * np.hypot(z[:, 0], z[:, 1])) ** 2
        return float((0.5 * self.modes.modal_mass * squared).sum())

    def energy_account(self) -> NDArray[np.float64]:
        return self.engine._account_opened


@pytest.mark.parametrize("tangent", [False, True])
def test_without_losses_the_modes_get_what_the_part_loses(tangent: bool) -> None:
    """An elastic ball without friction, several bounces off the centre of a plate at rest."""
    one = Undamped(
        on_plate(BALL | at(2.0, 1.0), contact={"restitution": 1.0, "friction": 0.0}, tangent_surface=tangent)
    )
    before = one.of_parts()
    one.engine.advance(80)
    got, energy_account = one.of_modes(), one.energy_account()
    assert got > 0.05 * before  # several percent, so that the equality says something
    assert before - one.of_parts() + energy_account[BY_CORRECTION] == pytest.approx(got, rel=EXACT)
    assert -energy_account[FROM_MODES] == pytest.approx(got, rel=EXACT)
    assert abs(energy_account[BY_IMPACTS]) < EXACT * got


@pytest.mark.parametrize("at_rest", [(2646.0,), MANY])
def test_with_losses_the_contact_law_dissipates_the_rest(at_rest: tuple[float, ...]) -> None:
    """Nuts that tumble: friction, several corners at once, and what one does to the plate the others feel."""
    nuts = [NUT | at(x, y) for x, y in ((0.0, 0.0), (30.0, 10.0), (-40.0, 40.0))]
    one = Undamped(on_plate(*nuts, at_rest=at_rest, contact={"restitution": 0.6, "friction": 0.3}))
    assert len(one.modes.rate) == len(at_rest) + 1
    start = last = one.of_parts()
    for _ in range(12):
        one.engine.advance(2)
        energy_account, modes = one.energy_account(), one.of_modes()
        assert one.of_parts() == pytest.approx(start + energy_account.sum(), rel=1e-9)
        assert -energy_account[FROM_MODES] == pytest.approx(modes, rel=EXACT)
        total = one.of_parts() + modes - energy_account[BY_CORRECTION]
        assert total <= last * (1 + 1e-12)
        last = total
    assert modes > 5e-5 * start and last < 0.8 * start


def test_an_impulse_pushes_every_mode_by_its_share() -> None:
    """The first impact of a ball that falls straight down: closed form."""
    e, scenario = 0.5, on_plate(BALL | at(5.0), contact={"restitution": 0.5, "friction": 0.0})
    one = Undamped(scenario)
    height = 1e-3 * scenario.part[0].start.drop_height_mm[0]
    frames = one.engine.advance(round(1.5 * np.sqrt(2 * height / GRAVITY) / one.scene.frame_interval))
    ball = one.scene.kinds[0]
    w = one.scene.surface.deflections(np.array([[5e-3, 0.0]]))[:, 0]
    inverse = 1 / ball.mass + (w**2 / one.modes.modal_mass).sum()
    impulse = (1 + e) * np.sqrt(2 * GRAVITY * height) / inverse
    z = one.engine._reaction_opened
    # A velocity v of a mode at the impact is -i v / w_d there: downwards where the mode shape is positive.
    assert z[:, 1] * one.modes.rate.imag == pytest.approx(impulse * w / one.modes.modal_mass, rel=0.01)
    assert np.abs(z[:, 0]).max() < 1e-9 * np.abs(z[:, 1]).max()
    after = frames.velocity[-1, 0, 2] + GRAVITY * (frames.time[-1] - z[0, 2])
    assert after == pytest.approx(-np.sqrt(2 * GRAVITY * height) + impulse / ball.mass, rel=0.01)


def test_a_surface_that_another_part_moves_is_met() -> None:
    """A fast ball hits a plate at rest, which then throws a nut that was about to fall for milliseconds."""
    ball = {"shape": "ball", "diameter_mm": 20.0} | at(0.0, velocity_mm_s=[0.0, 0.0, -3000.0])
    low = {"position_mm": [20.0, 0.0], "drop_height_mm": [0.02, 0.02], "tilt_deg": [0.0, 0.0]}
    scene = build_scene(on_plate(ball, NUT | {"start": low}, frames_per_second=1e5))
    engine, rate = ReactingEngine(scene, np.random.default_rng(0)), free_modes(scene.driven).rate
    frames = engine.advance(round(0.9e-3 / scene.frame_interval))  # in the first window
    reaction, nut, found = engine._reaction, scene.kinds[1], []
    assert np.hypot(*reaction[1, :2]) > 3e-5
    for row in np.flatnonzero(frames.time > 0.4e-3):  # after the ball; the nut itself moves the plate little
        turned = Rotation.from_quat(frames.quaternion[row, 1], scalar_first=True)
        corners = turned.apply(nut.corners) + frames.position[row, 1]
        q = reaction_at(reaction, rate, float(frames.time[row])).real
        found.append((corners[:, 2] - q @ scene.surface.deflections(corners[:, :2])).min())
    assert min(found) > -5e-6
    assert frames.velocity[-1, 1, 2] > 0.1  # it has been thrown


def test_the_drive_pays_for_what_parts_take() -> None:
    """A drive that pushes with the same force all the time feeds damping and parts: a (1 - a) = P / P_0.

    a is the amplitude over that without parts, P what they take on average, P_0 what damping takes without them.
    """
    scene = build_scene(on_plate(NUT | at(3.0), amplitude_um=5.0, duration_s=4.0))
    engine, modes, drive = ReactingEngine(scene, np.random.default_rng(3)), free_modes(scene.driven), scene.drives[1]
    zeta, omega = -modes.rate[1].real / abs(modes.rate[1]), abs(modes.rate[1])
    damping = zeta * modes.modal_mass[1] * omega**3 * drive.amplitude**2
    shares, taken, times = [], [], []
    while engine.current().time[0] < 4.0:
        engine.advance(10)
        times.append(float(engine._span[0]))
        taken.append(float(engine._account_opened[FROM_MODES]))
        alone = scene.surface.terms.phasor(times[-1], 2)[0, 1]
        shares.append(abs(1.0 + reaction_at(engine._reaction_opened, modes.rate, times[-1])[1] / alone))
    rung_up = int(np.searchsorted(times, 0.4))
    power = (taken[-1] - taken[rung_up]) / (times[-1] - times[rung_up])
    a = np.mean(shares[rung_up:])
    assert a < 0.995
    assert a * (1 - a) == pytest.approx(power / damping, rel=0.1)


def test_a_part_that_rides_puts_the_mode_out_of_tune() -> None:
    """A ball that hardly leaves the plate, below 1 g, adds its mass M w^2 to the mode; the drive stays as it was."""
    ball = {"shape": "ball", "diameter_mm": 3.0} | at(0.0, drop_height_mm=[0.001, 0.001])
    scene = build_scene(on_plate(ball, amplitude_um=0.02, contact={"restitution": 0.0}))
    engine, modes = ReactingEngine(scene, np.random.default_rng(0)), free_modes(scene.driven)
    engine.advance(140)  # nine times the time of the ring-up
    t, zeta = float(engine._span[0]), -modes.rate[1].real / abs(modes.rate[1])
    alone = scene.surface.terms.phasor(t, 2)[0, 1]
    added = scene.parts[0].mass * scene.surface.deflections(np.zeros((1, 2)))[1, 0] ** 2 / modes.modal_mass[1]
    expected = abs(2j * zeta / (2j * zeta - added))
    assert expected < 0.95
    assert abs(1.0 + reaction_at(engine._reaction_opened, modes.rate, t)[1] / alone) == pytest.approx(
        expected, rel=0.05
    )


@pytest.mark.parametrize("corners", [1, 6])
def test_infinitely_heavy_modes_are_a_prescribed_motion(corners: int) -> None:
    nut, rng = build_part(HexNut(size="M2.5")), np.random.default_rng(1)
    turned = Rotation.from_rotvec(rng.normal(size=3) * 0.01).as_matrix()
    arm = (nut.corners @ turned.T)[nut.corners[:, 2] < 0][:corners]
    inverse, touch = turned @ np.diag(1 / nut.inertia) @ turned.T, (arm, np.tile([0.0, 0.0, 1.0], (corners, 1)))
    found = []
    for modes in (None, modes_of(corners)):
        velocity, momentum = np.array([0.1, 0.02, -0.2]), np.array([1e-8, -2e-8, 1e-8])
        struck(nut.mass, inverse, (velocity, momentum), (*touch, np.full((corners, 3), 0.05)), (0.2, 0.3), modes)
        found.append(np.concatenate([velocity, momentum]))
    assert found[0] == pytest.approx(found[1], rel=1e-12, abs=1e-20)


def modes_of(contacts_: int) -> Modes:
    return Modes(np.zeros(2), np.ones((contacts_, 2, 3)), np.zeros(2))


def test_a_heavy_part_lowers_the_amplitude_and_the_guard_stays_calm() -> None:
    """A ball nearly half as heavy as the mode; no state is taken for diverged."""
    heavy = {"shape": "ball", "diameter_mm": 15.0} | at(0.0)
    scenario = on_plate(heavy, amplitude_um=10.0, duration_s=0.5)
    assert simulate(scenario).seeds[0].status == Status.DONE
    scene = build_scene(scenario)
    engine = ReactingEngine(scene, np.random.default_rng(0))
    engine.advance(200)
    assert np.hypot(*engine._reaction_opened[1, :2]) > 1e-6

"""Poisson's restitution against closed forms, at one point and at several, and its energy."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import from_python, symmetric
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from vertex_impacts import poisson_impulse as integrated

from feeder_sim.engines.impulse import poisson, single_impact
from feeder_sim.engines.impulse.contact_problem import (
    ARM_FIRST,
    ARM_SECOND,
    FRICTION,
    NORMAL,
    RESTITUTION,
    ROLLING,
    WORLD,
    Bodies,
    Contacts,
    new_room,
)

by_poisson, by_newton = from_python(poisson.poisson_impulse), from_python(single_impact.impulse_at_point)
without_limit = from_python(single_impact.impulse_to)
least_energy, poisson_impact = from_python(poisson.least_energy), from_python(poisson.poisson_impact)
integral = from_python(integrated)


def mobility(rng: np.random.Generator) -> NDArray[np.float64]:
    """Of a random body at a point of it (3, 3), with the normal last."""
    arm, turn = rng.normal(size=3), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    lengths = rng.uniform(0.1, 1.0, 3)
    inertia = turn @ np.diag((lengths @ lengths - lengths**2) / 3.0) @ turn.T
    cross = np.cross(np.eye(3), arm)
    return np.asarray(np.eye(3) + cross @ np.linalg.inv(inertia) @ cross.T, float)


def work(k: NDArray[np.float64], u: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    return float(p @ u + 0.5 * p @ k @ p)


def test_ball_is_the_same_by_both_laws() -> None:
    """A sphere of unit mass: 7/2 along the surface, 1 across it, and nothing of one by the other."""
    k, e, mu = (3.5, 0.0, 0.0, 3.5, 0.0, 1.0), 0.6, 0.3
    for slip in (0.3, 1.0, 1.7, 5.0):  # it sticks at the end of compression, of restitution, or not at all
        p = by_poisson(k, (0.6 * slip, -0.8 * slip, -1.0), e, mu)[1]
        size = min(slip / 3.5, mu * (1.0 + e))
        assert p == pytest.approx((-0.6 * size, 0.8 * size, 1.0 + e), abs=1e-13)
        assert p == pytest.approx(by_newton(k, (0.6 * slip, -0.8 * slip, -1.0), e, mu)[1], abs=1e-13)


def test_rod_that_falls_onto_its_end() -> None:
    """A thin rod of unit mass and length 2, at 60 degrees to the plate, that comes straight down.

    With the arm (x, y), K_tt = 1 + 3 y^2, K_tn = -3 x y, K_nn = 1 + 3 x^2. With friction above |K_tn| / K_tt = 0.4 the
    end sticks from the first on, and both impulses of compression are K^-1 (0, 1).
    """
    x, y, e = -0.5, -np.sqrt(0.75), 0.7
    tt, tn, nn = 1.0 + 3.0 * y * y, -3.0 * x * y, 1.0 + 3.0 * x * x
    k, determinant = (tt, 0.0, tn, 1.0, 0.0, nn), tt * nn - tn * tn
    sticks = (1.0 + e) * np.array([-tn, 0.0, tt]) / determinant
    assert by_poisson(k, (0.0, 0.0, -1.0), e, 0.8)[1] == pytest.approx(tuple(sticks), abs=1e-13)
    # With less it slips off, toward -x: the normal impulse of compression is 1 / (K_nn + mu K_tn).
    mu = 0.2
    pressed = (1.0 + e) / (nn + mu * tn)
    slips = (mu * pressed, 0.0, pressed)
    assert by_poisson(k, (0.0, 0.0, -1.0), e, mu)[1] == pytest.approx(slips, abs=1e-13)
    assert by_newton(k, (0.0, 0.0, -1.0), e, mu)[1] == pytest.approx(slips, abs=1e-12)


def test_newton_gains_energy_where_poisson_does_not() -> None:
    """A rod that slips, and sticks before the end: Newton's law alone would add energy (Kane and Levinson 1985)."""
    gains = 0
    for slip in np.linspace(0.0, 3.0, 61):
        x, y, e, mu = -0.6, -0.8, 0.9, 0.9
        k = np.array([[1.0 + 3.0 * y * y, 0.0, -3.0 * x * y], [0.0, 1.0, 0.0], [-3.0 * x * y, 0.0, 1.0 + 3.0 * x * x]])
        for u in (np.array([slip, 0.0, -1.0]), np.array([-slip, 0.0, -1.0])):
            newton = without_limit(symmetric(k), tuple(u), e, mu)[1]
            gains += work(k, u, np.array(newton)) > 1e-9
            assert work(k, u, np.array(by_poisson(symmetric(k), tuple(u), e, mu)[1])) <= 1e-13
    assert gains > 5


def test_friction_of_restitution_leaves_least_energy() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        a = rng.normal(size=(2, 2))
        k, u, limit = a @ a.T + 1e-3 * np.eye(2), rng.normal(size=2), rng.uniform(0.0, 2.0) * rng.choice([1.0, 1e-6])
        p = np.array(least_energy((k[0, 0], k[0, 1], k[1, 1]), tuple(u), limit))
        left = u + k @ p
        assert np.linalg.norm(p) <= limit * (1.0 + 1e-13)
        if np.linalg.norm(p) < limit * (1.0 - 1e-9):
            assert np.abs(left).max() < 1e-9 * np.linalg.norm(u)
        else:  # opposite to the slip that it leaves
            assert p @ left == pytest.approx(-limit * np.linalg.norm(left), abs=1e-9 * limit)


def test_single_impact_is_a_limit_on_friction_and_loses_energy() -> None:
    rng, jams = np.random.default_rng(4), 0
    for _ in range(2000):
        k, u, e, mu = mobility(rng), rng.normal(size=3), rng.uniform(), rng.uniform(0.0, 1.2)
        u[2] = -abs(u[2]) - 1e-3
        solved, p = by_poisson(symmetric(k), tuple(u), e, mu)
        if not solved:  # friction that holds itself: left to what solves several
            jams += 1
            continue
        p = np.array(p)
        after, small = u + k @ p, 1e-9 * float(np.linalg.norm(u))
        assert after[2] >= -small
        assert np.hypot(p[0], p[1]) <= mu * p[2] * (1.0 + 1e-9)
        assert work(k, u, p) <= 1e-12 * float(u @ u)
    assert jams < 40


def test_in_a_plane_it_is_the_integral() -> None:
    """Wang and Mason's impulses, with slip that ends, sticks or reverses in either phase."""
    rng = np.random.default_rng(5)
    reverses = 0
    for _ in range(2000):
        x, y, inertia = *rng.uniform(-1.0, 1.0, 2), rng.uniform(0.05, 1.0)
        m = 1.0 + y * y / inertia, 1.0 + x * x / inertia, x * y / inertia
        e, mu, slip, approach = rng.uniform(), rng.uniform(0.0, 1.2), rng.normal(), -rng.uniform(0.1, 1.0)
        tangential, normal = integral(slip, approach, m, mu, e)
        p = by_poisson((m[0], 0.0, -m[2], 1.0, 0.0, m[1]), (slip, 0.0, approach), e, mu)[1]
        assert (p[0], p[2]) == pytest.approx((tangential, normal), rel=1e-9, abs=1e-9)
        reverses += abs(tangential) < mu * normal * (1.0 - 1e-9) and mu * m[0] < abs(m[2])
    assert reverses > 50


def test_in_space_it_is_keller_s_integral() -> None:
    """With slip that turns: du / dp_n = K (-mu s, 1), with its direction s, to a hundredth of the impulse."""
    rng = np.random.default_rng(8)
    errors = []
    for _ in range(60):
        k, u, e, mu = mobility(rng), rng.normal(size=3), 0.6, 0.25
        u[2] = -abs(u[2]) - 0.1

        def rate(_: float, v: NDArray[np.float64], k: NDArray[np.float64] = k, mu: float = mu) -> NDArray[np.float64]:
            slip = v[:2] / np.linalg.norm(v[:2])
            return np.asarray(k @ [*(-mu * slip), 1.0], float)

        def ends(_: float, v: NDArray[np.float64]) -> float:
            return float(v[2])

        def sticks(_: float, v: NDArray[np.float64]) -> float:
            return float(np.hypot(v[0], v[1])) - 0.05

        ends.terminal = sticks.terminal = True  # type: ignore[attr-defined]
        end = solve_ivp(rate, (0.0, 50.0), u, events=(ends, sticks), rtol=1e-8)
        if not len(end.t_events[0]):
            continue
        path = solve_ivp(rate, (0.0, (1.0 + e) * end.t_events[0][0]), u, events=sticks, rtol=1e-8)
        if len(path.t_events[0]):
            continue  # slip that ends is not for this equation
        p = np.array(by_poisson(symmetric(k), tuple(u), e, mu)[1])
        exact = np.linalg.solve(k, path.y[:, -1] - u)
        errors.append(np.linalg.norm(p - exact) / np.linalg.norm(exact))
    assert len(errors) > 30 and max(errors) < 0.01


def heap(rng: np.random.Generator, bodies: int, n: int, rolling: float) -> tuple[Bodies, Contacts]:
    """Random bodies with n contacts between each other and the world."""
    room, contacts = new_room(bodies, n)
    room.velocity[:], room.spin[:] = rng.normal(size=(2, bodies, 3))
    place = rng.normal(size=(bodies, 3))
    for j in range(bodies):
        turn, lengths = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.uniform(0.2, 1.0, 3)
        mass = 10.0 ** rng.uniform(-1.0, 1.0)
        inertia = mass / 3.0 * turn @ np.diag(lengths @ lengths - lengths**2) @ turn.T
        room.inverse_mass[j], room.inverse_inertia[j] = 1.0 / mass, symmetric(np.linalg.inv(inertia))
    for i in range(n):
        second = rng.integers(bodies)
        first = rng.choice([WORLD, *(j for j in range(bodies) if j != second)])
        contacts.body[i] = first, second
        point = rng.normal(size=3)
        contacts.vector[ARM_FIRST, i], contacts.vector[ARM_SECOND, i] = point - place[first], point - place[second]
        normal = rng.normal(size=3)
        contacts.vector[NORMAL, i] = normal / np.linalg.norm(normal)
        contacts.number[FRICTION, i] = rng.uniform(0.0, 1.0)
        contacts.number[ROLLING, i] = rolling
    return room, contacts


def energy(bodies: Bodies) -> float:
    total = 0.0
    for v, w, m, turns in zip(*bodies, strict=True):
        a, b, c, d, e, f = turns
        total += v @ v / m + w @ np.linalg.solve([[a, b, c], [b, d, e], [c, e, f]], w)
    return 0.5 * float(total)


def approach(bodies: Bodies, contacts: Contacts) -> NDArray[np.float64]:
    rates = []
    for (first, second), arm_first, arm, normal in zip(
        contacts.body, contacts.vector[ARM_FIRST], contacts.vector[ARM_SECOND], contacts.vector[NORMAL], strict=True
    ):
        u = bodies.velocity[second] + np.cross(bodies.spin[second], arm)
        if first != WORLD:
            u = u - bodies.velocity[first] - np.cross(bodies.spin[first], arm_first)
        rates.append(u @ normal)
    return np.array(rates)


@pytest.mark.parametrize("rolling", [0.0, 0.1])
def test_several_contacts_lose_energy_and_none_approaches(rolling: float) -> None:
    rng, solved = np.random.default_rng(6), 0
    for trial in range(300):
        bodies, contacts = heap(rng, int(rng.integers(1, 4)), int(rng.integers(1, 7)), rolling)
        contacts.number[RESTITUTION] = rng.uniform(size=len(contacts.body)) if trial % 2 else rng.uniform()
        before = energy(bodies)
        if settled := poisson_impact(bodies, contacts, len(contacts.body), 0.0, 0.0):
            assert approach(bodies, contacts).min() > -1e-8
        solved += settled
        assert energy(bodies) <= before * (1.0 + 1e-12)
    assert solved > 280


@pytest.mark.parametrize("sliding", [0.0, 0.2, 3.0])
def test_block_that_lands_flat(sliding: float) -> None:
    """It leaves with e times its speed, and friction up to mu (1 + e) times it; no corner is preferred."""
    e, mu = 0.5, 0.2
    bodies, contacts = new_room(1, 4)
    bodies.velocity[0], bodies.inverse_mass[0] = (sliding, 0.0, -1.0), 1.0
    bodies.inverse_inertia[0] = symmetric(np.diag([0.0, 0.0, 1.0]))  # it cannot tip
    contacts.body[:] = WORLD, 0
    contacts.vector[ARM_SECOND] = [(x, y, -0.5) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    contacts.vector[NORMAL] = 0.0, 0.0, 1.0
    contacts.number[RESTITUTION], contacts.number[FRICTION] = e, mu
    assert poisson_impact(bodies, contacts, 4, 0.0, 0.0)
    left = max(0.0, sliding - mu * (1.0 + e))
    assert bodies.velocity[0] == pytest.approx((left, 0.0, e), abs=1e-11)
    assert np.abs(bodies.spin[0]).max() < 1e-11


def test_newtons_cradle_passes_the_impulse_on() -> None:
    """Three equal balls in a row at rest, hit by a fourth: all impulses of compression are shared, and come twice.

    By compression the four move on together with a quarter of the speed, so the last ball leaves with half of it by
    e = 1, where Newton's law for several contacts has another outcome.
    """
    bodies, contacts = new_room(4, 3)
    bodies.velocity[0, 0], bodies.inverse_mass[:] = 1.0, 1.0
    bodies.inverse_inertia[:] = symmetric(2.5 * np.eye(3))
    contacts.body[:] = [(0, 1), (1, 2), (2, 3)]
    contacts.vector[[ARM_FIRST, NORMAL]], contacts.vector[ARM_SECOND] = (1, 0, 0), (-1, 0, 0)
    contacts.number[RESTITUTION] = 1.0
    assert poisson_impact(bodies, contacts, 3, 0.0, 0.0)
    assert bodies.velocity[:, 0] == pytest.approx([-0.5, 0.5, 0.5, 0.5], abs=1e-11)

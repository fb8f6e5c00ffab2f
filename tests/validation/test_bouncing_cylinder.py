"""A cylinder on a standing wave, beside a published program: its speeds by its rules, and why the engine has others."""

from __future__ import annotations

import math
from typing import Any

import pytest
from bouncing_cylinder import SETTINGS, Setting, compute
from vertex_impacts import newton_impulse, poisson_impulse

from feeder_sim.machine_code import entry_point

ROUNDED = 0.05  # the published speeds are means of runs that differ from these by chance and round-off
BASE, SLOW_REBOUND = SETTINGS[0], SETTINGS[-1]


def speed(setting: Setting, method: str) -> tuple[float, float]:
    """Mean speed [mm/s] and its standard error."""
    found = compute(setting, method).speed_mm_s
    return found.mean, found.se


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_its_rules_give_the_speeds_of_the_published_program(setting: Setting) -> None:
    mean, se = speed(setting, "rules")
    published = 1e3 * setting.speed
    assert abs(mean - published) < 3.0 * math.sqrt(2.0) * se + ROUNDED * abs(published)
    assert abs(mean) > 5.0 * se


@pytest.mark.parametrize("law", [poisson_impulse, newton_impulse])
@pytest.mark.parametrize("slip", [0.3, -0.3, 5.0])
def test_both_laws_agree_on_a_central_impact(law: Any, slip: float) -> None:
    """Nothing couples the two directions: it sticks within friction, else it slips at its limit."""
    impulse = entry_point(law.py_func)
    tangential, normal = impulse(slip, -2.0, (3.0, 1.0, 0.0), 0.4, 0.5)
    assert normal == pytest.approx(3.0)
    assert tangential == pytest.approx(-slip / 3.0 if abs(slip) < 1.0 else -0.4 * 3.0)


def test_the_laws_differ_where_the_point_sticks_in_compression() -> None:
    """Poisson's law gives back a share of the normal impulse, Newton's of the normal velocity.

    slip' = 2 p_t - 0.5 p_n, approach' = -1 - 0.5 p_t + 1.5 p_n; with enough friction there is no slip after the first
    moment, p_t = p_n / 4, so that compression ends at p_n = 1 / (1.5 - 0.125). There both laws agree. From a slip of 1
    the point sticks at p_t = -p_n = -0.4, where the approach is -0.2.
    """
    laws: list[Any] = [poisson_impulse, newton_impulse]
    poisson, newton = (entry_point(law.py_func) for law in laws)
    m = 2.0, 1.5, 0.5
    for impulse in (poisson, newton):
        assert impulse(0.0, -1.0, m, 1.0, 0.5)[1] == pytest.approx(1.5 / 1.375)
    assert poisson(1.0, -1.0, m, 1.0, 0.5)[1] == pytest.approx(1.5 * (0.4 + 0.2 / 1.375))
    tangential, normal = newton(1.0, -1.0, m, 1.0, 0.5)
    assert -1.0 - 0.5 * tangential + 1.5 * normal == pytest.approx(0.5)
    assert 1.0 + 2.0 * tangential - 0.5 * normal == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_the_engine_has_the_speed_of_its_rules_with_newtons_restitution() -> None:
    """On a surface that moves up and down only the law of restitution makes a factor of 1.7."""
    (engine, engine_se), (newton, newton_se), (rules, _) = (speed(BASE, m) for m in ("engine", "newton", "rules"))
    assert abs(engine - newton) < 3.0 * math.hypot(engine_se, newton_se) + 0.1
    assert rules / engine > 1.4


@pytest.mark.slow
def test_with_in_plane_velocity_the_laws_agree() -> None:
    """There the speed is two to seven times higher; that vertices are joined to one matters after low rebounds."""
    engine, rules = (speed(BASE, method)[0] for method in ("engine_in_plane", "rules_in_plane"))
    assert engine == pytest.approx(rules, rel=0.1)
    assert engine < 3.0 * speed(BASE, "engine")[0] < 0.0
    low = {m: speed(SLOW_REBOUND, f"{m}_in_plane")[0] for m in ("engine", "rules", "vertices")}
    assert low["engine"] == pytest.approx(low["vertices"], rel=0.1)
    assert abs(low["engine"]) > 1.3 * abs(low["rules"])

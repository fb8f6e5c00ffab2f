"""What the commands print on stdout: text for people, or JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from feeder_sim.bifurcation import Diagram
    from feeder_sim.circulation import StageWave
    from feeder_sim.node_routes import Route
    from feeder_sim.plate.mode_file import ModeFile


def print_summary(summary: dict[str, Any], folder: Path, as_json: bool) -> None:
    """Print what a run found, in words or as one JSON object."""
    if as_json:
        print(json.dumps(summary | {"folder": str(folder)}))
        return
    speed = summary["transport_speed_mm_s"]
    print(summary["title"] or folder.name)
    if speed["n"]:
        interval = f" +- {speed['se']:.3f} (SE), SD {speed['sd']:.3f}" if speed["n"] > 1 else ""
        print(f"  transport speed  {speed['mean']:.3f} mm/s{interval}, n = {speed['n']} of {summary['seeds']} seeds")
    drift = [summary[f"drift_velocity_{axis}_mm_s"] for axis in "xy"]
    if "at_goal" in summary:
        _print_transport(summary)
    elif "picked" in summary:
        _print_separation(summary)
    for wave in summary.get("waves", []):
        _print_circulation(wave)
    if "picked" not in summary and drift[0]["n"] and "motion" not in summary:
        print(f"  mean drift       x {drift[0]['mean']:.3f}, y {drift[1]['mean']:.3f} mm/s")
        print(f"  highest rise     {summary['highest_rise_mm']['mean']:.3f} mm")
    if "motion" in summary:
        _print_bounces(summary)
    if summary["left_plate"]:
        print(f"  left the plate   {summary['left_plate']} of {summary['seeds']}")
    factor = summary["real_time_factor"] or 0.0
    print(f"  simulated        {summary['simulated_s']:.1f} s in {summary['wall_s']:.1f} s ({factor:.2f} x real time)")
    print(f"  recorded in      {folder}")


def _print_separation(summary: dict[str, Any]) -> None:
    """Counts over the ensemble, and those at the end of the last stage."""
    last = summary["stages"][-1]
    for label, found in (
        ("picked", summary["picked"]),
        ("lost", summary["lost"]),
        ("before last pick", last["on_plate"]),
    ):
        if found["n"]:
            spread = f", SD {found['sd']:.1f}" if found["n"] > 1 else ""
            print(f"  {label:<16} {found['mean']:.1f} of {summary['parts']}{spread}, n = {found['n']} seeds")


def _print_transport(summary: dict[str, Any]) -> None:
    found, took = summary["travelled_mm"], summary["arrival_time_s"]
    print(f"  arrived          {summary['at_goal']} of {summary['at_goal_of']}")
    for label, values, unit in (("travelled", found, "mm"), ("time", took, "s")):
        if values["n"]:
            spread = f", SD {values['sd']:.2f}" if values["n"] > 1 else ""
            print(f"  {label:<16} {values['mean']:.2f} {unit}{spread}, n = {values['n']} seeds")


def _print_circulation(wave: dict[str, Any]) -> None:
    speed, still = wave["circulation_mm_s"], wave["at_still_points"]
    if speed["n"]:
        interval = f" +- {speed['se']:.3f} (SE)" if speed["n"] > 1 else ""
        print(f"  circulation      {speed['mean']:+.3f} mm/s{interval}, counter-clockwise, n = {speed['n']} seeds")
    if still["n"]:
        print(f"  at still points  {100.0 * still['mean']:.0f} % of the parts")


def _print_bounces(summary: dict[str, Any]) -> None:
    units = {"bounce interval": ("bounce_interval_ms", "ms"), "flight height": ("flight_height_mm", "mm")}
    for label, (name, unit) in (units | {"impact speed": ("impact_speed_mm_s", "mm/s")}).items():
        found = summary[name]
        if found["n"] > 1:
            print(f"  {label:<16} {found['mean']:.4g} {unit} +- {found['se']:.2g} (SE), n = {found['n']}")
    print("  motion           " + ", ".join(f"{name} ({n} seeds)" for name, n in summary["motion"].items()))


def print_boundaries(diagram: Diagram, as_json: bool) -> None:
    """Print where each period begins, beside the exact value."""
    rows = [
        {
            "period": int(b.motion),
            "from_um": 1e6 * b.amplitude,
            "bracket_um": 1e6 * b.uncertainty,
            "exact_um": None if b.theory is None else 1e6 * b.theory,
            "deviation_percent": None if b.theory is None else 100.0 * (b.amplitude / b.theory - 1.0),
        }
        for b in diagram.boundaries
    ]
    ratios = diagram.feigenbaum_ratios()
    if as_json:
        print(json.dumps({"boundaries": rows, "feigenbaum_ratios": ratios}))
        return
    print("period  from (um)  exact (um)  deviation (%)")
    for row in rows:
        line = f"{row['period']:>6}  {row['from_um']:>9.5g}"
        print(
            line
            + ("" if row["exact_um"] is None else f"  {row['exact_um']:>10.5g}  {row['deviation_percent']:>+13.3f}")
        )
    if not rows:
        print("no boundary within the sweep")
    if ratios:
        print(f"ratios of successive doublings: {', '.join(f'{r:.3f}' for r in ratios)} (Feigenbaum: 4.669)")


def print_modes(held: ModeFile, as_json: bool) -> None:
    """Print the modes of a plate beside the measured resonances."""
    measured = {r.mode: r for r in held.resonances}
    rows = []
    for i, (frequency, parity) in enumerate(zip(held.modes.natural_frequency, held.modes.parity, strict=True)):
        resonance = measured.get(i)
        rows.append(
            {
                "mode": i + 1,
                "natural_frequency_hz": float(frequency),
                "symmetry": "".join(["even", "odd"][p][0] for p in parity),
                "measured_hz": resonance.frequency if resonance else None,
                "deviation_percent": 100.0 * (frequency / resonance.frequency - 1.0) if resonance else None,
            }
        )
    if as_json:
        print(json.dumps(rows))
        return
    print("mode  computed (Hz)  symmetry x,y  measured (Hz)  deviation (%)")
    for row in rows:
        line = f"{row['mode']:>4}  {row['natural_frequency_hz']:>13.1f}  {','.join(str(row['symmetry'])):>12}"
        if row["measured_hz"] is not None:
            line += f"  {row['measured_hz']:>13.1f}  {row['deviation_percent']:>+13.2f}"
        print(line)


def print_routes(routes: Sequence[Route], frequency: NDArray[np.float64], as_json: bool) -> None:
    """Print sequences of modes, best first: their largest k, and where every mode takes the part."""
    if as_json:
        rows = [
            {
                "largest_k": route.largest_k,
                "modes": [mode + 1 for mode in route.modes],
                "frequency_hz": [float(frequency[mode]) for mode in route.modes],
                "station_mm": [1e3 * route.steps[0].start, *(1e3 * step.end for step in route.steps)],
                "k": [step.k for step in route.steps],
                "growth": [step.growth if step.growth == step.growth else None for step in route.steps],
            }
            for route in routes
        ]
        print(json.dumps(rows))
        return
    for route in routes:
        print(f"largest k {route.largest_k:.3f}, modes {', '.join(str(mode + 1) for mode in route.modes)}")
        print("  mode  frequency (Hz)  from (mm)  to (mm)      k  offset grows by")
        for step in route.steps:
            line = f"  {step.mode + 1:>4}  {frequency[step.mode]:>14.1f}  {1e3 * step.start:>9.2f}"
            print(f"{line}  {1e3 * step.end:>7.2f}  {step.k:>5.3f}  {step.growth:>15.3g}")


def print_ratios(rows: Sequence[tuple[float, Sequence[Route]]], as_json: bool) -> None:
    """Print the best sequence of every length-to-width ratio."""
    if as_json:
        found = [
            {
                "ratio": ratio,
                "largest_k": routes[0].largest_k if routes else None,
                "growth": routes[0].growth if routes and routes[0].growth == routes[0].growth else None,
                "modes": [mode + 1 for mode in routes[0].modes] if routes else [],
            }
            for ratio, routes in rows
        ]
        print(json.dumps(found))
        return
    print("length/width  largest k  offset grows by  modes")
    for ratio, routes in rows:
        if routes:
            best = routes[0]
            numbers = ", ".join(str(mode + 1) for mode in best.modes)
            print(f"{ratio:>12.3f}  {best.largest_k:>9.3f}  {best.growth:>15.3g}  {numbers}")
        else:
            print(f"{ratio:>12.3f}  {'none':>9}")


def print_waves(waves: Sequence[StageWave], as_json: bool) -> None:
    """Print what the waves of a scenario are like."""
    from feeder_sim.circulation import described

    different = {wave.stage.excitations: wave for wave in reversed(waves)}
    rows = [{"stage": wave.stage.name} | described(wave) for wave in reversed(different.values())]
    if as_json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(f"{row['stage'] or 'wave'}")
        print(as_lines({key: value for key, value in row.items() if key != "stage"}, "  "))


def as_lines(plan: dict[str, Any], indent: str = "") -> str:
    """Nested values as indented 'key: value' lines."""
    lines = []
    for key, value in plan.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            for i, entry in enumerate(value):
                lines += [f"{indent}{key}[{i}]:", as_lines(entry, indent + "  ")]
        elif isinstance(value, list) and value and isinstance(value[0], str):
            lines += [f"{indent}{key}:", *(f"{indent}  {entry}" for entry in value)]
        else:
            lines.append(f"{indent}{key}: {_rounded(value)}")
    return "\n".join(lines)


def _rounded(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_rounded(entry) for entry in value) or "none"
    return str(value)

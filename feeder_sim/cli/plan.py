"""What `check` and `run --dry-run` say of a run before it is started, in sentences."""

from __future__ import annotations

from typing import Any

from feeder_sim.cli.report import LONGEST_TEXT, MOST_ENTRIES
from feeder_sim.document.words import number
from feeder_sim.errors import printable, shortened
from feeder_sim.notebook import counted

MOST_DRIVES = 3  # that are described; many schedules have dozens
MOST_KINDS = 3  # of parts


def plan_lines(plan: dict[str, Any]) -> str:
    """A plan, as JSON takes it, as a few lines for people."""
    lines = [plan["title"]] if plan["title"] else []
    lines += [f"Of the drawing {plan['drawing']}."] if plan["drawing"] else []
    lines += [_drive(drive) for drive in plan["drives"][:MOST_DRIVES]]
    if (more := len(plan["drives"]) - MOST_DRIVES) > 0:
        lines.append(f"And {counted(more, 'more drive')}, which --full describes.")
    if plan["antinode_to_node_mm"] is not None:
        lines.append(f"From antinode to node it is {plan['antinode_to_node_mm']:.4g} mm.")
    lines += [_parts(plan), f"The engine is {plan['engine']}: {plan['engine_because']}.", _cost(plan)]
    lines += [_measures(plan["measures"])]
    recommendations = [line for line in plan["recommended"] if not line.startswith("nothing")]
    for title, entries in (("Warnings", plan["warnings"]), ("Advice", recommendations)):
        lines += [f"{title}:", *(f"- {entry}" for entry in entries[:MOST_ENTRIES])] if entries else [f"{title}: none."]
        lines += [f"- and {more} more, which --json has"] if (more := len(entries) - MOST_ENTRIES) > 0 else []
    return "\n".join(shortened(printable(line), LONGEST_TEXT) for line in lines)


def _drive(drive: dict[str, Any]) -> str:
    """What moves how, where it moves most and under the parts."""
    name, _, computed = drive["mode"].partition(", ")
    what = f"{name[:1].upper()}{name[1:]}{f' ({computed})' if computed else ''}"
    line = f"{what} moves at {drive['frequency_hz']:g} Hz by {number(drive['antinode_amplitude_um'], 3)} um"
    low, high = drive["antinode_bounds_um"]
    if low < high:
        line += f" (within {number(low, 2)} to {number(high, 2)})"
    line += f" and {number(drive['peak_acceleration_g'], 3)} g at most"
    under = [_under(part) for part in drive["under_parts"][:MOST_KINDS]]
    line += f"; under {', under '.join(under)}" if under else ""
    line += f"; {drive['following_modes']} other modes follow" if drive["following_modes"] > 1 else ""
    line += "; one other mode follows" if drive["following_modes"] == 1 else ""
    level = drive["sound_dba_at_1_m"]
    return f"{line}.{'' if level is None else f' It is not louder than {level:.0f} dB(A) at 1 m.'}"


def _under(part: dict[str, Any]) -> str:
    """The median where the parts of a table start, and from where to where it goes if that matters."""
    least, median, largest = part["amplitude_um"]
    low = 0.0 if least < 1e-3 * largest else least  # on a nodal line what is left is round-off
    spread = f" ({number(low, 2)} to {number(largest, 3)})" if largest > 1.001 * least else ""
    return f"{part['part']} by {number(median, 3)} um{spread} and {number(part['peak_acceleration_g'], 3)} g"


def _parts(plan: dict[str, Any]) -> str:
    kinds = [f"{part['count']} {part['name']} of {part['mass_g']:.3g} g" for part in plan["parts"][:MOST_KINDS]]
    more = len(plan["parts"]) - MOST_KINDS
    kinds += [f"{counted(more, 'more kind')}"] if more > 0 else []
    size = " x ".join(f"{side:g}" for side in plan["plate_mm"])
    return f"On {size} mm of plate: {', '.join(kinds)}."


def _cost(plan: dict[str, Any]) -> str:
    most = " at most" if plan["estimates_are_upper_bounds"] else ""
    run = f"{counted(plan['seeds'], 'seed')} of {plan['simulated_s']:.4g} s in steps of {plan['timestep_us']:.3g} us"
    cost = f"{_time(plan['estimated_wall_s'])} on this machine and {number(plan['estimated_file_size_mb'], 2)} MB"
    return f"{run}: {cost}{most}."


def _time(seconds: float) -> str:
    """Wall time with a unit that suits it."""
    if seconds < 1.0:
        return "less than a second"
    size, unit = next((size, unit) for size, unit in ((3600.0, "h"), (60.0, "min"), (1.0, "s")) if seconds >= size)
    return f"about {number(seconds / size, 2)} {unit}"


def _measures(names: list[str]) -> str:
    """Measures of the whole run; those of stages are too many to be listed."""
    plain = [name for name in names if "[" not in name]
    more = f", and {len(names) - len(plain)} of stages or kinds, which --full lists" if len(plain) < len(names) else ""
    return f"It measures {', '.join(plain)}{more}."

"""Imports point one way: a module may only import those listed before it."""

from __future__ import annotations

import ast
from pathlib import Path

ORDER = [
    "errors",
    "hdf5_text",
    "materials",
    "tables",
    "plate_tables",
    "part_tables",
    "run_tables",
    "scenario",
    "timetable",
    "plate.modes",
    "plate.shapes",
    "plate.drive",
    "plate.surface",
    "plate.kernels",
    "plate.nodal_lines",
    "plate.mode_file",
    "plate.plate_file",
    "plate.assembly",
    "node_routes",
    "parts",
    "guide",
    "scene",
    "start",
    "units",
    "mjcf",
    "impacts",
    "removals",
    "trajectory",
    "trajectory_file",
    "engines",
    "engines.borrow",
    "engines.mujoco_library",
    "engines.surface_arrays",
    "engines.impact_log",
    "engines.free_flight",
    "engines.impact",
    "engines.impulse_state",
    "engines.tube",
    "engines.plate_contact",
    "engines.rest",
    "engines.window",
    "engines.hulls",
    "engines.pair_contact",
    "engines.neighbours",
    "engines.island",
    "engines.mujoco",
    "engines.impulse",
    "engines.slide",
    "advice",
    "measures",
    "bounces",
    "guard",
    "stage_lines",
    "picking",
    "seed_run",
    "separation",
    "wave",
    "circulation",
    "transport",
    "simulation",
    "bifurcation",
    "checkpoint",
    "replay_plate",
    "replay_parts",
    "replay_wave",
    "replay_crowd",
    "replay",
    "run_folder",
    "plan",
    "viewer",
    "pictures",
    "catalogue",
    "report",
    "command_files",
    "plate_commands",
    "chart.cases",
    "chart.methods",
    "chart.data_files",
    "chart.points",
    "chart.ladder",
    "chart.stability_map",
    "chart.drawing",
    "chart_command",
    "cli",
    "__main__",
]


def imported(path: Path) -> set[str]:
    """Modules of the package that a file imports, wherever in the file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("feeder_sim."):
            found.add(node.module.removeprefix("feeder_sim."))
    return found


def test_imports_point_one_way(repository: Path) -> None:
    package = repository / "feeder_sim"
    names = {}
    for path in package.rglob("*.py"):
        name = ".".join(path.relative_to(package).with_suffix("").parts).removesuffix(".__init__")
        if name not in ("__init__", "plate", "chart"):
            names[name] = path
    assert set(names) == set(ORDER)
    # The engine table names its engines, late, which is what a table is for.
    allowed_up = {("engines", "engines.mujoco"), ("engines", "engines.impulse"), ("engines", "engines.slide")}
    wrong = [
        (name, other)
        for name, path in names.items()
        for other in imported(path)
        if ORDER.index(other) >= ORDER.index(name) and (name, other) not in allowed_up
    ]
    assert wrong == []

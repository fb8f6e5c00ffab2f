"""Steps of a ball on the steering plate of Zhou et al. (2016), predicted for eight notes from dimensions alone.

    python benchmarks/validation/chladni_plate.py [--out steps.csv] [--picture chladni_plate.png] [--json]

Square of silicon, 50 x 50 x 0.525 mm, free, driven by a force in its middle; solder ball of 0.6 mm; notes of 500 ms
that rise and fall in straight lines, each with the amplitude at which three quarters of the steps are below 0.175 mm.
The file has the mean step of a ball from each of 21 x 21 places, for every note. The measured field is not here:
whoever has it compares it with the file.

--scale: the computed plate is driven at the note times this. Frequencies of the real plate are 3 % off those of a
computed one, and the gradients agree with the motion when scaled by 3 %; so 1.03, since a plate that carries a piezo is
heavier than a bare one and resounds lower. 1 drives at the note itself.

Takes 3 minutes on two cores, 1 with --quick.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from arguments import between, new_file

from feeder_sim.errors import InputError
from feeder_sim.plots.validation.chladni_plate import save_chladni_plate
from feeder_sim.studies.validation.chladni_plate import (
    NOTES_HZ,
    Assumed,
    Steps,
    chladni_modes,
    find_amplitude,
    note_field,
)
from feeder_sim.studies.validation.chladni_report import (
    BIN_EDGES,
    as_row,
    as_table,
    lag,
    profile,
    sensitivity,
    share,
    together,
    write_steps,
)

RUNS = 8
OTHER_RESTITUTIONS = (0.3, 0.7)
OTHER_FRICTIONS = (0.1, 0.5)
PICTURED_HZ = (7459.0, 14917.0)


def none_as_nan(value: float | None) -> float:
    return math.nan if value is None else value


def say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def study(assumed: Assumed, runs: int, *, others: bool) -> tuple[list[Steps], dict[str, Any]]:
    modes = chladni_modes()
    every, rows = [], []
    for note in NOTES_HZ:
        field = note_field(modes, note, assumed)
        steps = find_amplitude(field, note, runs, assumed, say)
        row = as_row(steps, profile(steps)) | {"lag": lag(modes, note, assumed)}
        row["gradient_cosine"] = sensitivity(modes, note, assumed)
        if others:
            changed = {f"restitution {e:g}": replace(assumed, restitution=e) for e in OTHER_RESTITUTIONS}
            changed |= {f"friction {mu:g}": replace(assumed, friction=mu) for mu in OTHER_FRICTIONS}
            row["other"] = {
                name: beside(steps, find_amplitude(field, note, runs, each, say)) for name, each in changed.items()
            }
        every.append(steps)
        rows.append(row)
    return every, {
        "assumed": assumed.__dict__,
        "runs": runs,
        "notes": rows,
        "profile": as_table(together([profile(steps) for steps in every])),
    }


def beside(steps: Steps, other: Steps) -> dict[str, float]:
    """The same note under another assumption: its amplitude, and how far its steps differ, over their rms."""
    apart = np.hypot(*(steps.step - other.step).T)
    return {
        "amplitude_um": 1e6 * other.amplitude,
        "mean_cosine": other.cosine,
        "share": share(other),
        "steps_apart": float(np.sqrt((apart**2).mean() / (steps.length**2).mean())),
    }


def print_report(table: dict[str, Any]) -> None:
    print("note   drive   amplitude  A w2/g  cosine  median  spread  lost  share  correlation with  lag")
    print("[Hz]   [Hz]    [um]                       [mm]    [mm]                 grad A  grad A2")
    for row in table["notes"]:
        spread = none_as_nan(row["spread_mm"])
        print(
            f"{row['note_hz']:<6g} {row['drive_hz']:<7.0f} {row['amplitude_um']:<10.2f} {row['throw_number']:<7.0f} "
            f"{row['mean_cosine']:<7.4f} {row['median_step_mm']:<7.3f} {spread:<7.3f} {row['lost']:<5} "
            f"{row['share']:<6.3f} {row['correlation_slope']:<7.3f} {row['correlation_gradient']:<9.3f} "
            f"{100 * row['lag']:.1f} %"
        )
    print(
        "\ndistance to the node over a quarter of the wavelength; means of step, |grad A|, |grad A^2|, over their means"
    )
    lengths = [table["profile"][name] for name in ("step", "slope", "gradient")]
    for low, high, *means in zip(BIN_EDGES[:-1], BIN_EDGES[1:], *lengths, strict=True):
        print(f"{low:.1f} - {high:.1f}" + "".join(f"{mean:>7.2f}" for mean in means))
    print("\nmean cosine with the bare gradient under other assumptions")
    for name in table["notes"][0]["gradient_cosine"]:
        print(f"{name:<22}" + "".join(f"{row['gradient_cosine'][name]:>7.2f}" for row in table["notes"]))
    for name in table["notes"][0].get("other", ()):
        for what, text in (
            ("amplitude_um", "um"),
            ("mean_cosine", "cosine"),
            ("share", "share"),
            ("steps_apart", "steps apart"),
        ):
            values = "".join(f"{row['other'][name][what]:>8.3f}" for row in table["notes"])
            print(f"{name + ', ' + text:<30}{values}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Assumed()
    parser.add_argument("--out", type=new_file, help="CSV file of the steps")
    parser.add_argument("--picture", type=new_file)
    parser.add_argument("--json", action="store_true")
    runs = f"at each place [{RUNS}]"
    parser.add_argument("--runs", type=int, choices=range(1, 101), metavar="N", default=RUNS, help=runs)
    ranges = {
        "restitution": (default.restitution, 0.0, 0.9),
        "friction": (default.friction, 0.0, 2.0),
        "damping": (default.damping_ratio, 1e-5, 0.1),
        "scale": (default.frequency_scale, 0.9, 1.1),
    }
    for name, (usual, low, high) in ranges.items():
        parser.add_argument(f"--{name}", type=between(low, high), default=usual, help=f"[{usual:g}]")
    parser.add_argument("--quick", action="store_true", help="leave out other restitutions and frictions")
    options = parser.parse_args()
    assumed = Assumed(options.restitution, options.friction, options.damping, options.scale)
    try:
        every, table = study(assumed, options.runs, others=not options.quick)
    except InputError as error:
        parser.error(str(error))
    if options.out:
        with options.out.open("w", encoding="utf-8", newline="") as file:
            write_steps(every, file)
    if options.picture:
        save_chladni_plate([steps for steps in every if steps.note in PICTURED_HZ], every, options.picture)
    if options.json:
        print(json.dumps(table))
    else:
        print_report(table)


if __name__ == "__main__":
    main()

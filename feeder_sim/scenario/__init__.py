"""Scenario files: TOML -> frozen, validated values. The only room that knows pydantic; keys carry their units."""

from feeder_sim.scenario.attachments import Actuator, Bar, BondedLayer, Mass
from feeder_sim.scenario.material import CustomMaterial, resolve_material
from feeder_sim.scenario.part import GivenState, Heap, PartTable, Placed, Scattered, Slide, Start, Tube
from feeder_sim.scenario.paths import input_files, with_files
from feeder_sim.scenario.plate import (
    Drive,
    Excitation,
    MeasuredResonance,
    ModePlate,
    PistonPlate,
    PlateBody,
    PlateFile,
    Rectangle,
    StillPlate,
    Strip,
)
from feeder_sim.scenario.refill import Refill, Robot
from feeder_sim.scenario.run import Contact, MujocoSettings, Run
from feeder_sim.scenario.scenario import (
    Scenario,
    check_scenario,
    load_actuator_file,
    load_outline_file,
    load_plate_file,
    load_scenario,
    parse_scenario,
    with_run,
)
from feeder_sim.scenario.schedule import Goal, Pick, Schedule, Settled, Stage
from feeder_sim.scenario.shapes import Ball, Box, Cylinder, Dimer, HexNut, MeshPart, PartSpec
from feeder_sim.scenario.uncertain import Uncertain

__all__ = [
    "Actuator",
    "Ball",
    "Bar",
    "BondedLayer",
    "Box",
    "Contact",
    "CustomMaterial",
    "Cylinder",
    "Dimer",
    "Drive",
    "Excitation",
    "GivenState",
    "Goal",
    "Heap",
    "HexNut",
    "Mass",
    "MeasuredResonance",
    "MeshPart",
    "ModePlate",
    "MujocoSettings",
    "PartSpec",
    "PartTable",
    "Placed",
    "Pick",
    "PistonPlate",
    "PlateBody",
    "PlateFile",
    "Rectangle",
    "Refill",
    "Robot",
    "Run",
    "Scattered",
    "Scenario",
    "Schedule",
    "Settled",
    "Slide",
    "Stage",
    "Start",
    "StillPlate",
    "Strip",
    "Tube",
    "Uncertain",
    "check_scenario",
    "input_files",
    "load_actuator_file",
    "load_outline_file",
    "load_plate_file",
    "load_scenario",
    "parse_scenario",
    "resolve_material",
    "with_files",
    "with_run",
]

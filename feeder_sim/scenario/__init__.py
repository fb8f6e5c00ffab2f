"""Scenario files: TOML -> frozen, validated values. The only room that knows pydantic; keys carry their units."""

from feeder_sim.scenario.attachments import Actuator, Bar, BondedLayer, Mass
from feeder_sim.scenario.material import CustomMaterial, resolve_material
from feeder_sim.scenario.part import Ball, Cylinder, Heap, HexNut, MeshPart, PartSpec, Scattered, Slide, Start, Tube
from feeder_sim.scenario.plate import (
    Drive,
    Excitation,
    MeasuredResonance,
    ModePlate,
    PistonPlate,
    PlateBody,
    PlateFile,
    Rectangle,
    Strip,
)
from feeder_sim.scenario.refill import Refill, Robot
from feeder_sim.scenario.run import Contact, MujocoSettings, Run
from feeder_sim.scenario.scenario import (
    Scenario,
    load_actuator_file,
    load_outline_file,
    load_plate_file,
    load_scenario,
    parse_scenario,
    with_run,
)
from feeder_sim.scenario.schedule import Goal, Pick, Schedule, Settled, Stage

__all__ = [
    "Actuator",
    "Ball",
    "Bar",
    "BondedLayer",
    "Contact",
    "CustomMaterial",
    "Cylinder",
    "Drive",
    "Excitation",
    "Goal",
    "Heap",
    "HexNut",
    "Mass",
    "MeasuredResonance",
    "MeshPart",
    "ModePlate",
    "MujocoSettings",
    "PartSpec",
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
    "Strip",
    "Tube",
    "load_actuator_file",
    "load_outline_file",
    "load_plate_file",
    "load_scenario",
    "parse_scenario",
    "resolve_material",
    "with_run",
]

"""Sequences with ground truth: a deforming tissue sheet under an endoscope. Every effect has its own switch."""

from endotsr.clips.simulator.settings import EFFECTS, SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import SequenceTruth, SimulatedSequence, simulate
from endotsr.clips.simulator.trajectories import MaterialTracks, material_at, material_tracks

__all__ = [
    "EFFECTS",
    "MaterialTracks",
    "SequenceTruth",
    "SimulatedSequence",
    "SimulatorSettings",
    "material_at",
    "material_tracks",
    "simulate",
    "with_effects",
]

"""Sequences with known truth: a deforming tissue sheet under an endoscope. Every effect has its own switch."""

from endotsr.simulator.settings import EFFECTS, SimulatorSettings, with_effects
from endotsr.simulator.simulate import SimulatedSequence, Truth, simulate

__all__ = ["EFFECTS", "SimulatedSequence", "SimulatorSettings", "Truth", "simulate", "with_effects"]

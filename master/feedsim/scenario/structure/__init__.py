"""Structure files: what a machine's structure is made of, as geometry or as finite-element matrices."""

from feedsim.scenario.structure.base import Damping, DampingStep, Structure

__all__ = ["Damping", "DampingStep", "Structure"]

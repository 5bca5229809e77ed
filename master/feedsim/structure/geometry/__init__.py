"""A machine written as geometry: beams, masses, guides and drives, assembled at any pose of its axes."""

from feedsim.structure.geometry.assemble import Assembler, assemble

__all__ = ["Assembler", "assemble"]

"""NC programs: files of SINUMERIK, ISO or Heidenhain's words, read as movements and dwells.

May use errors and units.
Start with moves.py: ``Moves``, what a program becomes.
"""

from feedsim.part_program.moves import Blending, Motion, Moves, Note

__all__ = ["Blending", "Motion", "Moves", "Note"]

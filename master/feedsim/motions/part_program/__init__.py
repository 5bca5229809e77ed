"""NC programs: files of SINUMERIK, ISO or Heidenhain's words, read as movements and dwells.

May use files (how a file is read) and errors.
Start with words.py: ``Moves``, what a program becomes; then interpreter.py, which executes
blocks, and movements.py, which executes their words.
"""

from feedsim.motions.part_program.reading import read_program
from feedsim.motions.part_program.words import Blending, Motion, Moves, Note

__all__ = ["Blending", "Motion", "Moves", "Note", "read_program"]

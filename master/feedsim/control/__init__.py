"""Parameters as controls call them: number, name, unit and conversion of a machine file's parameters, from one table;
and the values that files of a control hold.

May use errors.
Start with names.py; the table is names.csv. Files are read by archive.py, and reading.py makes values of our parameters
of what they hold.
"""

from feedsim.control.archive import Archive, Entry, Odd
from feedsim.control.formats import opened
from feedsim.control.names import CONTROLS, Name, known, names_of, table
from feedsim.control.reading import Reading, Refused, Taken, read

__all__ = [
    "CONTROLS",
    "Archive",
    "Entry",
    "Name",
    "Odd",
    "Reading",
    "Refused",
    "Taken",
    "known",
    "names_of",
    "opened",
    "read",
    "table",
]

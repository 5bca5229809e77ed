"""Parameters as controls call them: number, name, unit and conversion of a machine file's parameters, from one table.

May use errors.
Start with names.py; the table is names.csv.
"""

from feedsim.control.names import CONTROLS, Name, known, names_of

__all__ = ["CONTROLS", "Name", "known", "names_of"]

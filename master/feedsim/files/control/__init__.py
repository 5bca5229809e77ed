"""Parameters as controls call them: number, name, unit and conversion of a machine file's parameters, from one table;
and the values that files of a control hold.

May use errors.
Start with names.py; the table is names.csv. Files are read by archive.py, and reading.py makes values of our parameters
of what they hold.
"""

from feedsim.files.control.names import CONTROLS, Name, find_name, names_of, table

__all__ = ["CONTROLS", "Name", "find_name", "names_of", "table"]

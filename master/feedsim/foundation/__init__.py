"""What every room rests on: errors, units and the units' variables, arguments, and writing that is whole or not at all.

May use nothing of the other rooms.
Start with errors.py and units.py; outputs.py says how results are written.
"""

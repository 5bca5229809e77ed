"""Files that people write: YAML read with the line of every value, checked as models; and those of them that need no
machine, mappings of columns and tolerances.

May use fields and units; rooms above import its modules directly.
Start with checked.py.
"""

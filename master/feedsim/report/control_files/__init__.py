"""What files of a control and machine files have to do with each other: the reports of an import and of an export.

May use the report's core and what `feedsim.scenario` made of the files.
Start with imported.py.
"""

"""Drives and structure as one linear sampled system, friction off or at rest: responses, margins, stability.

May use structure, scenario and trace.
Start with system.py, which couples drive.py and plant.py; loops.py has the responses by their names.
"""

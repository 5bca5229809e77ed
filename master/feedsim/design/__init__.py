"""What to change on a machine, and how sure that is: draws from intervals, tuning, studies of many runs.

May use estimation, analysis, simulation and what is below them.
Start with tune/drive.py; uncertainty/ draws machines, sweep/ makes studies.
"""

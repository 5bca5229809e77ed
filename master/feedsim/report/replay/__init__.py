"""What a replay of a record leaves: replay.csv, summary.json, report.html and figures.

May use the report's core and what `feedsim.replay` found.
Start with report.py.
"""

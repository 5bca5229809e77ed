"""The report on modes of an axis from measured responses.

May use the rooms below reports.
Start with report.py.
"""

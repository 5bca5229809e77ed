"""What feedsim history leaves: values over months, what has changed, scatter of machines; report.html and CSV tables.

May use the report's core and the analyses.
Start with report.py.
"""

"""A machine's structure: its figures, pictures of it and of its modes, the page that holds them.

May use the report's core and what `feedsim.structure` found.
Start with report.py.
"""

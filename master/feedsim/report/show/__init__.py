"""What feedsim diff leaves: results and records over each other, as report.html, summary.json and figures/*.png.

May use the report's core, what the report of a run draws of circles, and the analyses.
Start with report.py; pictures.py has the pictures.
"""

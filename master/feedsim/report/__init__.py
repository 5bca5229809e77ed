"""Results as a person wants them: curves as CSV, summary.json, report.html and figures/*.png.

May use what the rooms below have found; resvg, pillow and jinja2 are its own. Each kind of report is a room of its own,
imported by the command that needs it: it fills a `content.Report`, and `results.write_report` writes that.
Start with content.py.
"""

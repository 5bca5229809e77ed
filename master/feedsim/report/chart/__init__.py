"""Charts as data: what a page draws by itself, to be zoomed into and read with a cursor, and what is drawn of it once.

May use the report's palette. The script that draws charts in a page: template/*.js.
Start with model.py, which says what a chart is; embedded.py is how a page holds its curves, svg.py draws it for readers
without script and for print, file.py makes files of that.
"""

from feedsim.report.chart.model import (
    Axis,
    Band,
    Chart,
    Curve,
    Dash,
    Grid,
    Level,
    Mark,
    Panel,
    Polar,
    column_of,
    spans,
)

__all__ = ["Axis", "Band", "Chart", "Curve", "Dash", "Grid", "Level", "Mark", "Panel", "Polar", "column_of", "spans"]

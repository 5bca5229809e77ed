"""Time series with names and units: the Trace, its CSV form, and the import of recorded data."""

from feedsim.trace.csv import read_csv, write_csv
from feedsim.trace.files import written_whole
from feedsim.trace.mat import convert_mat, read_mat
from feedsim.trace.recording import Recording, read_recording
from feedsim.trace.series import Series, as_series, read_series
from feedsim.trace.setpoints import read_setpoints
from feedsim.trace.table import Table, least_and_largest, release, stretches
from feedsim.trace.trace import Array, Trace, matches, matching

__all__ = [
    "Array",
    "Recording",
    "Series",
    "Table",
    "Trace",
    "as_series",
    "convert_mat",
    "least_and_largest",
    "matches",
    "matching",
    "read_csv",
    "read_mat",
    "read_recording",
    "read_series",
    "read_setpoints",
    "release",
    "stretches",
    "write_csv",
    "written_whole",
]

"""Time series and frequency responses with names and units: their files, and the import of recorded data.

May use how a file is read (files), units, outputs and errors.
Start with trace.py (the Trace), then cells.py and csv.py (how a file becomes one); frequency responses are in
response.py and response_files.py.
"""

from feedsim.files.trace.capture import Mark
from feedsim.files.trace.files import read_csv, read_signals, write_csv, written_whole
from feedsim.files.trace.recording import Recording, convert, read_recording
from feedsim.files.trace.series import Series, as_series, read_series
from feedsim.files.trace.trace import Array, Table, Trace, least_and_largest, match_names, matches, release, stretches

__all__ = [
    "Array",
    "Mark",
    "Recording",
    "Series",
    "Table",
    "Trace",
    "as_series",
    "convert",
    "least_and_largest",
    "match_names",
    "matches",
    "read_csv",
    "read_recording",
    "read_series",
    "read_signals",
    "release",
    "stretches",
    "write_csv",
    "written_whole",
]  # fmt: skip

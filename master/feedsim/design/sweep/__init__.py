"""Studies of many runs: designs, the engine that makes the runs, the journal, the table, what moves the figures.

May use analysis and all below it; Dask and pyarrow are its own.
Start with study.py, which makes the runs of a study.
"""

from feedsim.design.sweep.design import Design, Matrices, Outcome, Task, design
from feedsim.design.sweep.table import Table, read_table, write_table

__all__ = ["Design", "Matrices", "Outcome", "Table", "Task", "design", "read_table", "write_table"]

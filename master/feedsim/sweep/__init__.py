"""Studies of many runs: designs, the engine that makes the runs, the journal, the table."""

from feedsim.sweep.design import Design, Matrices, design
from feedsim.sweep.table import Table
from feedsim.sweep.table_files import read_table, write_table
from feedsim.sweep.task import Outcome, Task

__all__ = ["Design", "Matrices", "Outcome", "Table", "Task", "design", "read_table", "write_table"]

"""Study files: a scenario, what is varied in it from run to run, and how the runs are spread.

May use a scenario and the fields of its files.
Start with load.py, which reads a file; study.py is what it becomes.
"""

from feedsim.scenario.study.load import load_study
from feedsim.scenario.study.study import Choice, Distribution, Parameter, Sampling, Study

__all__ = ["Choice", "Distribution", "Parameter", "Sampling", "Study", "load_study"]

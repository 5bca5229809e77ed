"""From motions to a run that can be trusted: setpoints, units and the control cycle, judgement, SSP files.

May use scenario, structure, linear and what is below them.
Start with cosim/run.py; nc/ has the setpoints, judge/ whether a run can be trusted, ssp/ the files of other simulators.
"""

"""Records of a control beside the simulated machine: replayed in closed loop, compared, and the drive identified by it.

May use identify (records, the position loop), cosim, nc, scenario and trace.
Start with closed_loop.py: a record's setpoints through the units; then compare.py, what is left, and drive.py.
"""

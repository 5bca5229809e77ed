"""The system of Fig. 2 as one SSP file for other people's simulators, and such a file run by feedsim.

May use cosim, structure, nc, scenario and trace.
Start with export.py and, the other way, opened.py.
"""

from feedsim.simulation.ssp.export import ExportedSystem, export
from feedsim.simulation.ssp.opened import OpenedSystem, open_system

__all__ = ["ExportedSystem", "OpenedSystem", "export", "open_system"]

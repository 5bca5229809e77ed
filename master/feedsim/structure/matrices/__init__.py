"""Finite-element models of other programs: Matrix Market, ANSYS and CalculiX matrices with ports, as an Assembly.

May use the scenario's models of a structure, assembly and the names of ports.
Start with build.py: ``import_model``. A reader per format gives it what raw.py describes.
"""

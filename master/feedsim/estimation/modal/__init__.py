"""Measured frequency responses of an axis -> its rigid motion, delays and elastic modes, as a table of modes.

May use structure (the table of modes), scenario, trace, units and errors.
Start with measured.py (what is measured, from time signals or response files), then rational.py (the fit).
"""

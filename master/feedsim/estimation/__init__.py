"""Fits of parameters: what a parameter is, methods of least squares, and how well the estimates are known.

May use errors. Every command that fits parameters asks here: identify, identify-drive, circle, identify-modes.
Start with parameter.py, then least_squares.py; fit.py, secant.py and robust.py are methods. covariance.py and
interval.py judge what they give.
"""

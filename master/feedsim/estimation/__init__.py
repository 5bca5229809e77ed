"""Fits of parameters: what a parameter is, methods of least squares, and how well the estimates are known.

May use errors. Every command that fits parameters asks here: identify, identify-drive, circle, identify-modes.
Start with parameter.py, then least_squares.py, which has the methods and judges what they give.
"""

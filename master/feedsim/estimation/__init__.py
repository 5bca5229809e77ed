"""How well estimated values are known: intervals, the rule for "not determined", covariance of correlated residuals.

May use trace's arrays. Every command that fits parameters asks here: identify, identify-drive, circle, identify-modes.
Start with interval.py.
"""

"""Values for parameters of drives, found by simulation: compensations, feedforward, gains.

May use uncertainty, analysis, cosim, linear, structure, scenario.
Start with knobs.py: the parameters, and what bounds them; drive.py and circles.py search.
"""

"""What to change: parameters of drives that make a circle rounder or a stop shorter, with the value proposed.

May use uncertainty, analysis, cosim, linear, structure, scenario.
Start with proposals.py; the closed forms are in closed_forms.py.
"""

from feedsim.design.tune.proposals import Proposal, of_circle, of_drives, of_run

__all__ = ["Proposal", "of_circle", "of_drives", "of_run"]

"""Why a circle is not round: the radial deviation of one direction or of both taken apart into causes.

May use analysis.figures, analysis.circularity, trace and units. Simulated circles and recorded ones are the same to it.
Start with model.py, the terms and their fit (estimation/least_squares.py); diagnosis.py says what share of G each term
has.
"""

from feedsim.analysis.circle.diagnosis import Diagnosis, Peak, Term, Vibration, diagnose
from feedsim.analysis.circle.geometry import CircleUnderTest, TurnedPath
from feedsim.analysis.circle.model import separating_radius
from feedsim.analysis.circle.words import (
    actionable_causes,
    cause_sentence,
    describe_vibrations,
    explain_circle,
    suggest_circles,
    term_name,
)

__all__ = [
    "CircleUnderTest",
    "Diagnosis",
    "Peak",
    "Term",
    "TurnedPath",
    "Vibration",
    "actionable_causes",
    "cause_sentence",
    "describe_vibrations",
    "diagnose",
    "explain_circle",
    "separating_radius",
    "suggest_circles",
    "term_name",
]

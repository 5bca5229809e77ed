"""Results against references: a tube of tolerance in value and in time around every variable.

May use files (tolerances) and trace.
Start with compare.py; tube.py is the method.
"""

from feedsim.comparison.between import bounds, bounds_of, interpolate_at, thin_series
from feedsim.comparison.compare import compare
from feedsim.comparison.files import compare_files, compare_series, pairs_of, tolerances_of, unusable
from feedsim.comparison.likeness import EXIT_CODES, Comparison, Coverage, Curves, Proposal, Variable, percent, seconds
from feedsim.comparison.options import Options
from feedsim.comparison.shift import Shift, estimated_shift
from feedsim.comparison.tolerance import DEFAULT_TOLERANCE, Tolerance, Tolerances

__all__ = [
    "DEFAULT_TOLERANCE",
    "EXIT_CODES",
    "Comparison",
    "Coverage",
    "Curves",
    "Options",
    "Proposal",
    "Shift",
    "Tolerance",
    "Tolerances",
    "Variable",
    "bounds",
    "bounds_of",
    "compare",
    "compare_files",
    "compare_series",
    "estimated_shift",
    "interpolate_at",
    "pairs_of",
    "percent",
    "seconds",
    "thin_series",
    "tolerances_of",
    "unusable",
]  # fmt: skip

"""What ``import feedsim`` offers a person: files in, results out, as Python people expect it.

May use every room but the command line; nothing uses it but the package itself.
Start with calls.py; result.py is what a run returns.
"""

from feedsim.front.calls import compare, frf, identify, load, run, sweep
from feedsim.front.overlay import Overlay, show
from feedsim.front.result import Result

__all__ = ["Overlay", "Result", "compare", "frf", "identify", "load", "run", "show", "sweep"]

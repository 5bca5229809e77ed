"""Checks of a finite-element model before it is solved."""

from feedsim.structure.checks.model import check

__all__ = ["check"]

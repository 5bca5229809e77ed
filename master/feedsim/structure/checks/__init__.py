"""Checks of a finite-element model before it is solved, each fault with its own message.

May use assembly alone, beside numpy and scipy.
Start with model.py: ``check``.
"""

"""Frequency responses: curves, figures, the page that holds them."""

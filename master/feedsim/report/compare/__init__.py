"""Comparisons as a person and a CI server want them: HTML with the violated band, JUnit XML, JSON."""

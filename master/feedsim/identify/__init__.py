"""Friction parameters from traces."""

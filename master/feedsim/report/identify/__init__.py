"""The report of an identification of friction."""

"""What ``import feedsim`` offers a person: files in, results out, as Python people expect it.

May use every room but the command line; nothing uses it but the package itself.
Start with calls.py; result.py is what a run returns. The package names each file itself, so that a comparison does
without what runs need.
"""

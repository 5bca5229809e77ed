"""python -m feedsim: the command line."""

from feedsim.cli import entry

if __name__ == "__main__":
    entry()

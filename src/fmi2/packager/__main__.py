"""Entry point for `python src/fmi2/packager ...` and `python -m feedsim_packager ...`."""

import sys
from pathlib import Path

if __package__:
    from .cli import main
else:
    # Run as a directory: the directory itself heads sys.path, which would hide standard modules behind ours.
    directory = Path(__file__).resolve().parent
    sys.path[:] = [entry for entry in sys.path if not entry or Path(entry).resolve() != directory]
    sys.path.insert(0, str(directory.parent))

    from packager.cli import main

if __name__ == "__main__":
    sys.exit(main())

"""python -m feedsim: where the script is not on the path."""

import subprocess
import sys


def test_python_m_feedsim() -> None:
    done = subprocess.run([sys.executable, "-m", "feedsim", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("feedsim ")
    assert (
        subprocess.run([sys.executable, "-m", "feedsim", "nonsense"], capture_output=True, check=False).returncode == 2
    )

#!/bin/sh
# Guards an import: results of your simulator against references, in one line of any CI.
#
#   FEEDSIM=feedsim-0.1.0-py3-none-any.whl sh compare.sh results references --tol 1e-6
#
# What stands behind it goes to `feedsim compare`. Leaves feedsim.xml (JUnit: a variable outside its tolerance is a
# failure, a result that is missing or cannot be read is an error). Exit codes: 0 same, 1 different, 2 unusable.
#
#   FEEDSIM   what pip installs: a wheel, or an address of one; nothing is installed where it is not set
#   PYTHON    default python3
#   JUNIT     default feedsim.xml
set -eu
if [ -n "${FEEDSIM:-}" ]; then
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
    "${PYTHON:-python3}" -m venv "$place"
    PATH="$place/bin:$PATH"
    python -m pip install --quiet --disable-pip-version-check "$FEEDSIM" || exit 2
elif ! command -v feedsim >/dev/null; then
    echo "compare.sh: no feedsim on the search path; FEEDSIM names the wheel to install" >&2
    exit 2
fi
feedsim compare "$@" --junit "${JUNIT:-feedsim.xml}"

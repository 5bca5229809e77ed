#!/bin/sh
# Guards an import: results of your simulator against references, in one line of any CI.
#
#   FEEDSIM=feedsim-0.3.0-py3-none-any.whl sh compare.sh --tol 1e-6 -- results references
#
# What stands behind it goes to `feedsim compare`. Behind -- are names of files alone, also where they begin with "-".
# Leaves feedsim.xml (JUnit: a variable outside its tolerance is a failure, a result that is missing or cannot be read
# is an error). Exit codes: 0 same, 1 different, 2 unusable.
#
#   FEEDSIM         what pip installs: a wheel, or an address of one; nothing is installed where it is not set
#   FEEDSIM_SHA256  its sum, as SHA256SUMS of the release has it; pip installs nothing else then
#   PYTHON          default python3
#   JUNIT           default feedsim.xml
#
# The packages that the wheel needs are those of requirements.lock beside this file, held to their hashes.
set -eu
if [ -n "${FEEDSIM:-}" ]; then
    here=$(dirname -- "$0")
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
    "${PYTHON:-python3}" -m venv "$place"
    PATH="$place/bin:$PATH"
    python -m pip install --quiet --disable-pip-version-check --require-hashes -r "$here/requirements.lock" || exit 2
    if [ -n "${FEEDSIM_SHA256:-}" ]; then
        case $FEEDSIM in
        *://* | /* | ./*) wheel=$FEEDSIM ;;
        *) wheel=./$FEEDSIM ;;
        esac
        printf '%s --hash=sha256:%s\n' "$wheel" "$FEEDSIM_SHA256" >"$place/wheel.lock"
        python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r "$place/wheel.lock" || exit 2
    else
        python -m pip install --quiet --disable-pip-version-check --no-deps "$FEEDSIM" || exit 2
    fi
elif ! command -v feedsim >/dev/null; then
    echo "compare.sh: no feedsim on the search path; FEEDSIM names the wheel to install" >&2
    exit 2
fi
feedsim compare --junit "${JUNIT:-feedsim.xml}" "$@"

"""Where the packages lie; everything else about the distribution is in pyproject.toml.

pyproject.toml can look for packages in folders, but not give one a name that is not its folder's: the packager is
`src/fmi2/packager` to those who build the units, and must not take a name as common as that among installed packages.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages("master"), "feedsim_packager"],
    package_dir={"": "master", "feedsim_packager": "src/fmi2/packager"},
)

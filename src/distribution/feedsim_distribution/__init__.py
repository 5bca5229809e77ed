"""Makes what is handed out: wheels and the source archive (PEP 517 backend, which pip calls).

    backend    what pip calls
    project    pyproject.toml and the files of the project
    metadata   what a wheel says of itself
    shipped    what a wheel holds besides Python: archives, native libraries, scenarios
    wheel      -> the wheel
    sdist      -> the source archive
    sbom       -> the bill of materials
    release    -> all that is handed out of a version

May use the packager. The same sources and the same compiler give the same bytes.
"""

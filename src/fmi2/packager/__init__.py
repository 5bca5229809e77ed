"""Packs a unit (`src/<unit>_fmu` with the shell in `src/fmi2`) into an FMI 2.0 co-simulation archive.

    toolchain      which C compiler there is, and how to run it
    units          unit expressions -> SI base units and conversion factors
    table          variables.def, through the C preprocessor -> rows, checked
    resources      axes.csv, modes.csv and poses.bin of the plant -> checked, hashed, embedded
    poses          checks poses.bin
    machine        what an archive says of its machine in words
    variables      rows and axes -> the flat list of FMI variables, and the GUID
    description    -> modelDescription.xml
    documentation  -> documentation/
    compile        flat sources folder -> shared library of the host platform
    trial          instantiates what was built, before it is packed
    archive        files <-> deterministic zip, written whole or not at all
    build          all of the above, in order
    carried        the table as an archive carries it
    repack         an archive and another machine's resources -> that machine's archive, without a compiler
    cli            commands

The package builds without anything from `master/`. Building needs markdown-it-py, repacking the standard library alone.
With feedsim it is installed as `feedsim_packager`; from the checkout it runs as `python src/fmi2/packager`.
"""

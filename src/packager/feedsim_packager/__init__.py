"""Packs a unit (`src/<unit>_fmu` with the shell in `src/fmi2`) into an FMI 2.0 co-simulation archive.

    toolchain      which C compiler there is, and how to run it
    units          unit expressions -> SI base units and conversion factors
    table          variables.def, through the C preprocessor -> rows, checked
    resources      files that a unit reads: what all kinds of them have in common
    machine_tables axes.csv, modes.csv, poses.bin and mounts.csv of the plant -> checked, embedded
    setpoints      setpoints.csv of the unit setpoint -> written, checked, embedded
    kinds          the kinds of resources, and which files make them
    poses          checks poses.bin
    machine        what an archive says of its machine or motion in words
    variables      rows and axes -> the flat list of FMI variables, and the GUID
    description    -> modelDescription.xml
    documentation  -> documentation/
    terminals      -> terminalsAndIcons/ and model.png
    targets        the platforms, and how zig names them
    compile        flat sources folder -> shared library for a platform
    native         libraries of C that the master calls, compiled: cycle loop, path planner
    universal      Mach-O libraries for several processors -> one file
    portable       whether a library runs on machines other than this one
    binary         a library's symbols, from the file (elf, pe, macho; symbols: what they have in common)
    trial          instantiates what was built, before it is packed
    archive        files <-> deterministic zip, written whole or not at all
    build          all of the above, in order
    carried        the table as an archive carries it
    cycle          the control cycle as data -> lists
    declared       the tables of all units as the master reads them
    repack         an archive and other resources -> the archive of that machine or motion, without a compiler
    checkout       where a checkout has what archives are made from
    cli            commands

The package builds without anything from `master/`. Building needs markdown-it-py, repacking the standard library alone.
It is installed with feedsim; in a checkout without an installation, `PYTHONPATH=src/packager` serves as well.
"""

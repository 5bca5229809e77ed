"""Packs a unit (`src/<unit>_fmu` with the shell in `src/fmi2`) into an FMI 2.0 co-simulation archive.

    toolchain      which C compiler there is, and how to run it
    units          unit expressions -> SI base units and conversion factors
    table          variables.def, through the C preprocessor -> rows, checked
    resources      axes.csv and modes.csv of the plant -> checked, hashed, embedded
    variables      rows and axes -> the flat list of FMI variables, and the GUID
    description    -> modelDescription.xml
    documentation  -> documentation/
    compile        flat sources folder -> shared library of the host platform
    trial          instantiates what was built, before it is packed
    archive        files -> deterministic zip, written whole or not at all
    build          all of the above, in order
    cli            commands

The package builds without anything from `master/`; its one dependency beyond the standard library is markdown-it-py.
"""

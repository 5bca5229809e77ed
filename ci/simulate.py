"""Run every reference case of an archive through FMPy: python simulate.py UNIT.fmu REFERENCES RESULTS"""

import csv
import sys
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from fmpy import read_model_description, simulate_fmu

archive, references, results = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
with ZipFile(archive) as file:
    file.extractall(references, [name for name in file.namelist() if name.startswith("extra/")])
folder = references / "extra" / "org.fmi-standard.fmi-ls-ref"
types = {variable.name: variable.type for variable in read_model_description(archive).modelVariables}
# FMPy holds inputs over a step, as most importers do: held/ has what comes out then.
if not list(folder.glob("*_ref.csv")):
    sys.exit(f"{archive}: holds no reference results")
held = [path.name for path in folder.glob("held/*_ref.csv")]
for reference in sorted(folder.rglob("*_ref.csv")):
    if reference.parent == folder and reference.name in held:
        reference.unlink()
        continue
    case = reference.name.removesuffix("_ref.csv")
    options = dict(csv.reader((folder / f"{case}_ref.opt").open()))
    parameters = {}
    if (file := folder / f"{case}_par.csv").is_file():
        parameters = dict(list(csv.reader(file.open()))[1:])
    for name, value in parameters.items():  # FMPy wants truth values as such
        parameters[name] = bool(float(value)) if types[name] == "Boolean" else value
    with reference.open() as file:
        outputs = next(csv.reader(file))[1:]
    inputs = None
    if (file := folder / f"{case}_in.csv").is_file():
        inputs = np.genfromtxt(file, delimiter=",", names=True, deletechars="")
    result = simulate_fmu(
        archive,
        start_time=float(options["StartTime"]),
        stop_time=float(options["StopTime"]),
        output_interval=float(options["StepSize"]),
        start_values=parameters,
        input=inputs,
        output=outputs,
    )
    place = results / reference.relative_to(references)
    place.parent.mkdir(parents=True, exist_ok=True)
    heads = ",".join(f'"{name}"' for name in result.dtype.names)
    np.savetxt(place, result, delimiter=",", fmt="%.17g", header=heads, comments="")

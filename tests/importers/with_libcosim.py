"""libcosim: a system built through its Python interface, or an SSP file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from importers.system import Experiment, Result, System, boolean

NANOSECONDS = 1e9
BUFFER = 4096  # samples that an observer keeps


def run(system: System | Path, experiment: Experiment) -> Result:
    """Step a system, or the SSP file of one."""
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    step = round(experiment.step * NANOSECONDS)
    slaves = []  # must outlive the execution
    if isinstance(system, Path):
        execution = CosimExecution.from_ssp_file(str(system), step)
        names = [info.name.decode() for info in execution.slave_infos()]
        index = {name: execution.slave_index_from_instance_name(name) for name in names}
    else:
        execution = CosimExecution.from_step_size(step)
        index = {}
        for name, component in system.components.items():
            slave = CosimLocalSlave(str(component.archive), name)
            slaves.append(slave)
            index[name] = execution.add_local_slave(slave)
    variables = {
        (name, variable.name.decode()): variable
        for name, i in index.items()
        for variable in execution.slave_variables(i)
    }
    if not isinstance(system, Path):
        for source, target in system.connections:
            connect = execution.connect_boolean_variables if boolean(source[1]) else execution.connect_real_variables
            connect(index[source[0]], variables[source].reference, index[target[0]], variables[target].reference)
        for name, component in system.components.items():
            for variable, value in component.start.items():
                kind = CosimVariableType(variables[name, variable].type)
                give = {
                    CosimVariableType.REAL: execution.real_initial_value,
                    CosimVariableType.INTEGER: execution.integer_initial_value,
                    CosimVariableType.BOOLEAN: execution.boolean_initial_value,
                    CosimVariableType.STRING: execution.string_initial_value,
                }[kind]
                assert give(index[name], variables[name, variable].reference, value), (name, variable, value)
    observer = CosimObserver.create_time_series(BUFFER)
    assert execution.add_observer(observer)
    for instance, variable in experiment.record:
        observer.start_time_series(index[instance], variables[instance, variable].reference, CosimVariableType.REAL)
    result: Result = {key: np.full(experiment.steps + 1, np.nan) for key in experiment.record}
    done = 0
    while done < experiment.steps:
        count = min(BUFFER, experiment.steps - done)
        assert execution.step(count), "libcosim could not step"
        for key, values in result.items():
            _, steps, samples = observer.time_series_real_samples(
                index[key[0]], variables[key].reference, done + 1, count
            )
            values[np.array(steps)] = samples
        done += count
    return result

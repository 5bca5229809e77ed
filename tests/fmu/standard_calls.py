"""Which function FMI 2.0.4 allows when: the table of section 4.2.4, co-simulation, written down from the text of the
standard and from nothing of ours."""

STATES = ("instantiated", "initialization mode", "step complete", "terminated", "error")

# 'x' allowed; a digit: allowed under a condition (notes below); '.' not allowed. Not listed are the states that a unit
# without asynchronous steps and without fmi2Discard never enters: step in progress, failed, canceled; and fatal.
_TABLE = """
fmi2GetTypesPlatform          x x x x x
fmi2GetVersion                x x x x x
fmi2SetDebugLogging           x x x x x
fmi2FreeInstance              x x x x x
fmi2SetupExperiment           x . . . .
fmi2EnterInitializationMode   x . . . .
fmi2ExitInitializationMode    . x . . .
fmi2Terminate                 . . x . .
fmi2Reset                     x x x x x
fmi2GetReal                   . 2 x x 7
fmi2GetInteger                . 2 x x 7
fmi2GetBoolean                . 2 x x 7
fmi2GetString                 . 2 x x 7
fmi2SetReal                   1 3 6 . .
fmi2SetInteger                1 3 6 . .
fmi2SetBoolean                1 3 6 . .
fmi2SetString                 1 3 6 . .
fmi2GetFMUstate               x x x x 7
fmi2SetFMUstate               x x x x x
fmi2FreeFMUstate              x x x x x
fmi2SerializedFMUstateSize    x x x x x
fmi2SerializeFMUstate         x x x x x
fmi2DeSerializeFMUstate       x x x x x
fmi2GetDirectionalDerivative  . x x x 7
fmi2SetRealInputDerivatives   x x x . .
fmi2GetRealOutputDerivatives  . . x x 7
fmi2DoStep                    . . x . .
fmi2CancelStep                . . . . .
fmi2GetStatus                 . . x x .
fmi2GetRealStatus             . . x x .
fmi2GetIntegerStatus          . . x x .
fmi2GetBooleanStatus          . . x x .
fmi2GetStringStatus           . . x x .
"""
# 1  variables with initial "exact" or "approx" (not inputs)
# 2  outputs, and what is listed under InitialUnknowns
# 3  variables with initial "exact", and inputs
# 6  inputs and tunable parameters
# 7  always, but the values are for debugging only

ALLOWED = {
    name: {state: mark for state, mark in zip(STATES, marks, strict=True) if mark != "."}
    for name, *marks in (line.split() for line in _TABLE.split("\n") if line)
}

# Where the units answer although the standard would let them refuse, because importers ask: after a step that failed
# fmi2GetStatus and its kin, which are there to say so.
ANSWERED_BEYOND = {(name, "error") for name in ALLOWED if name.endswith("Status")}


def allowed(name: str, state: str) -> bool:
    return state in ALLOWED[name] or (name, state) in ANSWERED_BEYOND

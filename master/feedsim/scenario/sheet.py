"""What an acceptance sheet needs besides the readings: limits, the uncertainty of the measurement, conditions."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictBool, StrictStr

from feedsim.fields import Model, Quantity, did_you_mean, fault

# Figures that a limit can be given for, by the kind of test.
OF_POSITIONING = ("A", "A_up", "A_down", "R", "R_up", "R_down", "B", "B_mean", "E", "E_up", "E_down", "M")
OF_CIRCLES = ("G", "G_b", "F_max", "F_min", "D")
Limit = Annotated[float, Quantity("m", above=0, example="10 um")]


class Sheet(Model):
    """An acceptance sheet: sheet.html for print, sheet.csv and, where it is asked for, sheet.xlsx."""

    limits: dict[StrictStr, Limit] = Field(default={}, description="Figure -> largest magnitude that passes")
    uncertainty: Annotated[float, Quantity("m", minimum=0, example="0.5 um")] = Field(
        default=0.0, description="Expanded uncertainty (k = 2) of the figures, by which a result must keep clear"
    )
    conditions: dict[StrictStr, StrictStr] = Field(
        default={}, description="Condition of the test -> what it was, such as instrument: laser interferometer"
    )
    xlsx: StrictBool = Field(default=False, description="Write sheet.xlsx too, a workbook of all sheets of the run")


def checked(sheet: Sheet | None, known: tuple[str, ...]) -> Sheet | None:
    """The sheet, whose limits are of figures that its test has."""
    for name in sheet.limits if sheet is not None else ():
        if name not in known:
            raise fault(f"limits: no figure {name!r}{did_you_mean(name, [*known])}")
    return sheet

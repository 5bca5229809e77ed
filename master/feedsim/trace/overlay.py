"""Measured frequency responses to lay over calculated ones: from CSV or universal files, named as told.

A text "FILE" reads all responses of a file under their own names, "FILE:NAME" the only one (or that called NAME) as
NAME, "FILE:NAME=SOURCE" the response SOURCE of the file, "FILE:NAME=MAGNITUDE,PHASE" two columns of a CSV file.
"""

from __future__ import annotations

from pathlib import Path

from feedsim.errors import InputError
from feedsim.trace.response import FrequencyResponse
from feedsim.trace.response_csv import columns_named, read_response_csv
from feedsim.trace.uff import read_response_uff

UNIVERSAL = (".uff", ".unv", ".uf", ".bunv")


def read_response(path: str | Path) -> FrequencyResponse:
    """Responses of a file: a universal file by its ending (.uff, .unv, .uf, .bunv), CSV otherwise; InputError."""
    path = Path(path)
    return read_response_uff(path) if path.suffix.lower() in UNIVERSAL else read_response_csv(path)


def read_overlay(text: str) -> FrequencyResponse:
    """Responses as `text` asks for them (see above).

    Raises:
        InputError: what the readers refuse; a name that the file does not have, or none where it has several.
    """
    # the colon of a Windows drive is none of ours
    at = text.find(":", 2)
    path, wanted = (Path(text), "") if at < 0 else (Path(text[:at]), text[at + 1 :])
    if at >= 0 and not wanted:
        raise InputError(f"{text!r}: behind the colon the name of a response is expected, such as Z.n_a/Z.M_a")
    name, _, source = (part.strip() for part in wanted.partition("="))
    if "," in source:
        if path.suffix.lower() in UNIVERSAL:
            raise InputError(f"{text!r}: a universal file has no columns; name the response, as in 12:+Z/7:+X")
        return read_response_csv(path, columns={name: columns_named([part.strip() for part in source.split(",")])})
    response = read_response(path)
    if not name:
        return response
    if not source:
        if name in response:
            source = name
        elif len(response.names) == 1:
            source = response.names[0]
        else:
            raise InputError(
                f"{path} holds {len(response.names)} responses and none is called {name!r}; say which one it is: "
                f"{path.name}:{name}=SOURCE; there is {', '.join(response.names)}"
            )
    return FrequencyResponse(
        response.frequency,
        {name: response[source]},
        {name: response.unit(source)},
        {name: response.coherence[source]} if source in response.coherence else {},
    )

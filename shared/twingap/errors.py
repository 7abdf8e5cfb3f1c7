"""The exception type of all errors that a user can cause."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 1500
"""Longest message, in characters; the middle of longer ones, such as of a hostile name, is left out."""


class TwingapError(Exception):
    """An error in the user's input; the message states what is wrong, where, and the remedy.

    Parameters
    ----------
    what : str
        What is wrong, with the offending value.
    where : str, optional
        File, row, column, key or option that is wrong.
    mend : str, optional
        Remedy.

    Notes
    -----
    ``str(error)`` is always one line without control characters; the command line prints it and exits with status 2.
    """

    def __init__(self, what: str, *, where: object = None, mend: str | None = None) -> None:
        self.what, self.where, self.mend = what, where, mend
        line = what if where is None else f"{where}: {what}"
        if mend is not None:
            line += f"; {mend}"
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in " ".join(line.split()))
        super().__init__(line if len(line) <= _LONGEST else f"{line[: _LONGEST - 200]} ... {line[-200:]}")


_MANY = 8
"""Number of names above which only the one that was probably meant is shown."""


def one_of(wrong: str, known: Iterable[str], kind: str) -> str:
    """Remedy for a name that is not known: the name that was probably meant, and all that there are if they are few.

    Parameters
    ----------
    wrong : str
    known : iterable of str
    kind : str
        What the names are of, in the plural.
    """
    names = list(known)
    swapped = [name for name in names if sorted(name.lower()) == sorted(wrong.lower())]
    parts = [name for name in names if wrong and wrong.lower() in name.lower()]
    likely = swapped or (parts if len(parts) < _MANY else []) or difflib.get_close_matches(wrong, names, n=1)
    meant = f"did you mean {' or '.join(map(repr, likely))}? " if likely else ""
    if likely and len(names) > _MANY:
        return f"{meant}{len(names)} {kind} are known"
    return f"{meant}known {kind}: {', '.join(names)}"

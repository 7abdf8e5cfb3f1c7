"""The one exception that a user can cause."""

from __future__ import annotations


class TwingapError(Exception):
    """Something in the user's input is at fault; the message says what, where and how to mend it.

    Parameters
    ----------
    what : str
        What is wrong, with the offending value.
    where : str, optional
        File, row, column, key or option at fault.
    mend : str, optional
        What to do about it.

    Notes
    -----
    ``str(error)`` is always one line, since the command line prints exactly that and exits 2.
    """

    def __init__(self, what: str, *, where: object = None, mend: str | None = None) -> None:
        self.what, self.where, self.mend = what, where, mend
        line = what if where is None else f"{where}: {what}"
        if mend is not None:
            line += f"; {mend}"
        super().__init__(" ".join(line.split()))

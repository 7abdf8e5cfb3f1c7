"""Commands as they are typed."""

from __future__ import annotations

import sys

import pytest

from tests.twingap.cli.typed import Run, Said
from twingap.cli import main
from twingap.effects import registry


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `twingap ...` in this process; effects that a command loads are known to it alone."""

    def run(*arguments: object) -> Said:
        monkeypatch.setattr(sys, "argv", ["twingap", *map(str, arguments)])
        before = registry.own_effects()
        with pytest.raises(SystemExit) as left:
            main()
        registry.replace_own(before)
        said = capsys.readouterr()
        return Said(int(left.value.code or 0), said.out, said.err)

    return run

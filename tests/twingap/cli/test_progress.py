"""Progress where standard error is no terminal: a line now and then, and at the end of what took long."""

from __future__ import annotations

import time

import pytest

from twingap.cli.progress import progress, steps


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    said = capsys.readouterr()
    assert said.out == ""
    return said.err.splitlines()


def test_lines_come_while_a_stage_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("reading", every_s=0.2) as shown:
        shown.share("searches", 0.25)
        time.sleep(0.5)
        shown.share("tests", 0.5)
        shown.count("cases", 3, 12)
        time.sleep(0.3)
    said = lines(capsys)
    assert said[0] == "twingap: searches: 25 %, 0 s since the start"
    assert any(line.startswith("twingap: searches: done in ") for line in said)
    assert any(line.startswith("twingap: cases: 25 %, ") for line in said)
    assert not any("tests" in line or "reading" in line for line in said), "what is quick is not mentioned"


def test_quick_work_and_failures_leave_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(steps("abc", "write", 3)) == ["a", "b", "c"]
    with pytest.raises(ValueError, match="no"), progress("reading", every_s=0.05) as shown:
        shown.step("one")
        raise ValueError("no")
    time.sleep(0.2)
    assert lines(capsys) == []


def test_steps_name_what_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("verify", 4, every_s=0.2) as shown:
        shown.step("cwru")
        time.sleep(0.3)
    assert lines(capsys)[0] == "twingap: verify: 25 %, cwru, 0 s since the start"

"""Configuration: what fits is built, what does not is named by file, key, value and what was expected."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from twingap.bearing import Bearing
from twingap.config import build, read_toml, to_toml
from twingap.errors import TwingapError


@dataclass(frozen=True)
class Inner:
    gain: float = 1.0


@dataclass(frozen=True)
class Outer:
    n: int
    name: str = "a"
    kind: Literal["x", 1] = "x"
    on: bool = False
    rate: float | None = None
    either: int | str = 0
    where: Path = Path()
    sizes: tuple[int, ...] = ()
    levels: dict[str, float] = field(default_factory=dict)
    inner: Inner = Inner()
    many: tuple[Inner, ...] = ()


def _build(text: str, folder: Path) -> Outer:
    (folder / "c.toml").write_text(text, encoding="utf-8")
    return build(Outer, read_toml(folder / "c.toml"), folder / "c.toml")


def test_what_fits_is_built(tmp_path: Path) -> None:
    text = """\ufeff
        n = 3
        name = "größe"
        kind = 1
        on = true
        rate = 2
        either = "text"
        where = "some where"
        sizes = [1, 2]
        levels = {a = 1, b = 2.5}
        inner.gain = 3
        many = [{gain = 1}, {}]
    """
    got = _build(text, tmp_path)
    assert got == Outer(
        3, "größe", 1, True, 2.0, "text", Path("some where"), (1, 2), {"a": 1.0, "b": 2.5}, Inner(3.0),
        (Inner(1.0), Inner()),
    )  # fmt: skip
    assert isinstance(got.rate, float)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "c.toml: key 'n' is missing; add n = a whole number"),
        ("n = 1\nm = 2", "c.toml: unknown key 'm'; known keys: n, name, kind"),
        ("n = 1.0", "c.toml: n: 1.0 found, a whole number expected"),
        ("n = true", "c.toml: n: True found, a whole number expected"),
        ("n = 1\nname = 2", "c.toml: name: 2 found, a string expected"),
        ("n = 1\nkind = 'z'", "c.toml: kind: 'z' found, one of 'x', 1 expected"),
        ("n = 1\nkind = true", "c.toml: kind: True found, one of 'x', 1 expected"),
        ("n = 1\non = 1", "c.toml: on: 1 found, true or false expected"),
        ("n = 1\nrate = nan", "c.toml: rate: nan found, a finite number expected"),
        ("n = 1\nrate = 1" + "0" * 400, "found, a finite number expected"),
        ("n = 1\neither = 1.5", "c.toml: either: 1.5 found, a whole number or a string expected"),
        ("n = 1\nsizes = [1, 'a']", "c.toml: sizes[1]: 'a' found, a whole number expected"),
        ("n = 1\nsizes = 1", "c.toml: sizes: 1 found, a list, each a whole number expected"),
        ("n = 1\nlevels.a = 'b'", "c.toml: levels.a: 'b' found, a finite number expected"),
        ("n = 1\ninner = 1", "c.toml: inner: 1 found, a table expected"),
        ("n = 1\ninner.gian = 1", "c.toml: inner: unknown key 'gian'; known keys: gain"),
        ("n = 1\nmany = [{gain = 'a'}]", "c.toml: many[0]: gain: 'a' found, a finite number expected"),
        ("n = ", "c.toml: is not valid TOML: Invalid value"),
        ("n = 1\nn = 2", "is not valid TOML: Cannot overwrite a value"),
        ("n = 1" + "0" * 5000, "is not valid TOML"),
        ("n = 2000-02-31", "is not valid TOML"),
        ("n = " + "[" * 5000, "is not valid TOML"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(TwingapError) as caught:
        _build(text, tmp_path)
    assert reason in str(caught.value)
    assert len(str(caught.value)) < 400


def test_an_objects_own_refusal_names_the_file() -> None:
    table = {"name": "b", "n_rollers": 2, "roller_diameter_mm": 1.0, "pitch_diameter_mm": 9.0}
    with pytest.raises(TwingapError, match=r"x\.toml: bearing 'b': n_rollers = 2, expected at least 3"):
        build(Bearing, table, "x.toml")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "latin.toml").write_bytes("a = 'ö'".encode("latin-1"))
    for name, reason in (
        ("gone.toml", "gone.toml: cannot be read: No such file"),
        (".", "cannot be read: Is a directory"),
        ("latin.toml", "latin.toml: is not UTF-8 text; save it as UTF-8"),
    ):
        with pytest.raises(TwingapError) as caught:
            read_toml(tmp_path / name)
        assert reason in str(caught.value)


SCALARS = (
    st.text(st.characters(exclude_categories=["Cs"]))
    | st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
)
KEYS = st.text(st.characters(exclude_categories=["Cs"]), max_size=5)
TABLES = st.recursive(
    st.dictionaries(KEYS, SCALARS | st.lists(SCALARS, max_size=3), max_size=4),
    lambda inner: st.dictionaries(KEYS, SCALARS | inner, max_size=4),
    max_leaves=8,
)


@given(TABLES)
@example({"": {"a.b": "\x7f\x00\n\"'\\😀"}, "x": {"y": {}}})
@settings(max_examples=150, deadline=None)
def test_toml_that_is_written_is_read_back(table: dict[str, Any]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.toml"
        path.write_text(to_toml(table), encoding="utf-8", newline="")
        assert read_toml(path) == table


def test_toml_leaves_none_out_and_refuses_the_rest() -> None:
    assert to_toml({"a": None, "b": {"c": None, "d": (1, 2.0, Path("x"))}}) == '[b]\nd = [1, 2.0, "x"]\n'
    with pytest.raises(TypeError, match="has no place in TOML"):
        to_toml({"a": {1, 2}})


@given(st.text(st.sampled_from("n=ame\"'[]{}.,#1e-_:Ttrue\n ü\0"), max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_text_is_configuration_or_one_line(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        try:
            assert _build(text, Path(folder)).n is not None
        except TwingapError as error:
            assert "\n" not in str(error)
            assert "c.toml" in str(error)

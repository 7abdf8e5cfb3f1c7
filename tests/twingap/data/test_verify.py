"""Verification: every way in which a file can be wrong is found, and nothing else."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twingap.data import manifest_names, manifest_of
from twingap.data.manifest import Manifest
from twingap.data.verify import Verification, bytes_to_hash, digest, verify

CONTENTS = {"a.bin": b"abcdef" * 1000, "deeper/b.bin": bytes(range(256)) * 9000, "c.bin": b"", "d é.bin": b"d"}
Make = Callable[..., Manifest]
Write = Callable[[Path, dict[str, bytes]], None]


def found(check: Verification) -> dict[str, str]:
    return {finding.path: finding.status for finding in check.findings if finding.status != "ok"}


def test_intact_files_are_ok(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    lay_out(tmp_path, CONTENTS)
    check = verify(facts, tmp_path)
    assert [finding.status for finding in check.findings] == ["ok"] * 4
    assert check.intact
    assert bytes_to_hash(facts, tmp_path) == sum(map(len, CONTENTS.values()))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, len(CONTENTS["deeper/b.bin"]) - 1), bit=st.integers(0, 7))
def test_a_flipped_bit_is_found_wherever_it_is(
    small_set: Make, lay_out: Write, tmp_path: Path, place: int, bit: int
) -> None:
    facts = small_set(CONTENTS)
    broken = bytearray(CONTENTS["deeper/b.bin"])
    broken[place] ^= 1 << bit
    lay_out(tmp_path, CONTENTS | {"deeper/b.bin": bytes(broken)})
    check = verify(facts, tmp_path)
    assert found(check) == {"small/deeper/b.bin": "altered"}
    assert not check.intact
    finding = next(f for f in check.findings if f.status == "altered")
    assert finding.expected == "sha256:" + hashlib.sha256(CONTENTS["deeper/b.bin"]).hexdigest()
    assert finding.found == "sha256:" + hashlib.sha256(broken).hexdigest()
    assert finding.mend


def test_a_truncated_file_is_found_by_its_size(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    lay_out(tmp_path, CONTENTS | {"a.bin": CONTENTS["a.bin"][:-1]})
    for quick in (False, True):
        check = verify(facts, tmp_path, quick=quick)
        finding = next(f for f in check.findings if f.status == "altered")
        assert finding.path == "small/a.bin"
        assert "(6000 bytes)" in (finding.expected or "")
        assert "(5999 bytes)" in (finding.found or "")


def test_missing_and_extra_files_are_named_and_no_alteration(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    rest = {name: content for name, content in CONTENTS.items() if name != "c.bin"}
    lay_out(tmp_path, rest | {"e.bin": b"extra", ".hidden": b"passed over"})
    check = verify(facts, tmp_path)
    assert found(check) == {"small/c.bin": "missing", "small/e.bin": "unexpected"}
    assert check.intact
    extra = next(f for f in check.findings if f.status == "unexpected")
    assert extra.expected is None
    assert extra.found == "sha256:" + hashlib.sha256(b"extra").hexdigest()


def test_quick_does_not_vouch_for_what_it_has_not_hashed(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    lay_out(tmp_path, CONTENTS)
    assert verify(facts, tmp_path, quick=True).count("ok") == 0


def test_an_absent_set_is_not_here(small_set: Make, tmp_path: Path) -> None:
    check = verify(small_set(CONTENTS), tmp_path)
    assert not check.here
    assert check.intact
    assert check.count("missing") == 4


def test_git_blob_ids_are_git_s(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"hello\n")
    assert digest(path, "git-blob") == "git-blob:ce013625030ba8dba906f756967f9e9ca394464a"  # git's own for "hello\n"
    git = subprocess.run(["git", "hash-object", path], capture_output=True, text=True, check=False)
    if git.returncode == 0:
        assert digest(path, "git-blob") == "git-blob:" + git.stdout.strip()


def test_a_file_known_by_git_blob_alone_is_checked(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    content = b"official"
    item = {
        "@type": "cr:FileObject",
        "@id": "small/o.mat",
        "contentUrl": "https://example.org/o.mat",
        "contentSize": "8 B",
        "twingap:gitBlobId": hashlib.sha1(b"blob 8\0" + content).hexdigest(),
    }
    facts = small_set({}, items=[item])
    lay_out(tmp_path, {"o.mat": content})
    assert found(verify(facts, tmp_path)) == {}
    lay_out(tmp_path, {"o.mat": b"0fficial"})
    assert found(verify(facts, tmp_path)) == {"small/o.mat": "altered"}


def test_files_known_by_pattern_are_counted(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    item = {"@type": "cr:FileSet", "@id": "small/s", "includes": "run/*.csv", "twingap:fileCount": 3}
    facts = small_set({}, items=[item])
    lay_out(tmp_path, {"run/1.csv": b"1", "run/2.csv": b"2"})
    check = verify(facts, tmp_path)
    assert [(f.status, f.expected, f.found) for f in check.findings] == [
        ("missing", "3 files", "2 files"),
        ("unchecked", "3 files", "2 files"),
    ]
    lay_out(tmp_path, {"run/3.csv": b"3"})
    assert [f.status for f in verify(facts, tmp_path).findings] == ["unchecked"]


def test_progress_counts_every_byte(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    lay_out(tmp_path, CONTENTS)
    sizes: list[int] = []
    verify(facts, tmp_path, progress=sizes.append)
    assert sum(sizes) == bytes_to_hash(facts, tmp_path)


def test_linked_folders_are_followed_once(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    facts = small_set(CONTENTS)
    elsewhere = tmp_path / "elsewhere"
    lay_out(elsewhere, CONTENTS)
    (tmp_path / "root").mkdir()
    (tmp_path / "root" / "small").symlink_to(elsewhere / "small")
    (elsewhere / "small" / "deeper" / "loop").symlink_to(elsewhere / "small")
    assert found(verify(facts, tmp_path / "root")) == {}


def test_an_unreadable_file_counts_as_altered(small_set: Make, lay_out: Write, tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root reads everything")
    facts = small_set(CONTENTS)
    lay_out(tmp_path, CONTENTS)
    (tmp_path / "small" / "a.bin").chmod(0)
    assert found(verify(facts, tmp_path)) == {"small/a.bin": "altered"}


@pytest.mark.data
def test_the_real_data_are_what_the_manifests_say(real_root: Path) -> None:
    here = 0
    for name in manifest_names():
        check = verify(manifest_of(name), real_root)
        here += check.count("ok")
        assert not [f for f in check.findings if f.status in ("altered", "unexpected")]
    assert here > 0

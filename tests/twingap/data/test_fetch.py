"""Fetching, from a server of the test's own that can break off, forget ranges and lie."""

from __future__ import annotations

import hashlib
import http.server
import io
import os
import stat
import threading
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from twingap.data import manifest_of
from twingap.data.fetch import fetch
from twingap.data.manifest import FilePattern, Manifest
from twingap.data.unpack import require_unpackers, unpack
from twingap.errors import TwingapError

Make = Callable[..., Manifest]


class Owner:
    """What the server offers and how it behaves."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.break_after: int | None = None
        self.ranges = True
        self.asked: list[tuple[str, str | None]] = []
        self.address = ""


@pytest.fixture
def owner() -> Iterator[Owner]:
    held = Owner()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = self.headers.get("Range")
            held.asked.append((self.path, asked))
            content = held.files.get(self.path)
            if content is None:
                self.send_error(404)
                return
            start = int(asked.removeprefix("bytes=").rstrip("-")) if asked and held.ranges else 0
            if start >= len(content) and asked:
                self.send_error(416)
                return
            self.send_response(206 if start else 200)
            self.send_header("Content-Length", str(len(content) - start))
            self.end_headers()
            self.wfile.write(content[start:][: held.break_after])

        def log_message(self, format: str, *args: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        held.address = f"http://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        yield held
        server.shutdown()


def offered(owner: Owner, content: bytes, name: str = "x.bin", **own: Any) -> dict[str, Any]:
    """A file that the owner offers, as the manifest lists it."""
    owner.files[f"/{name}"] = content
    return {
        "@type": "cr:FileObject",
        "@id": f"small/{name}",
        "contentUrl": f"{owner.address}/{name}",
        "contentSize": f"{len(content)} B",
        "sha256": hashlib.sha256(content).hexdigest(),
    } | own


CONTENT = bytes(range(256)) * 4000


def left_in(root: Path) -> list[str]:
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def test_downloads_verifies_and_does_so_once(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    facts, root = small_set({}, items=[offered(owner, CONTENT)]), tmp_path / "root é"
    seen: list[tuple[str, int, int | None]] = []
    first = fetch(facts, root, progress=lambda *told: seen.append(told))
    assert first.downloaded == (root / "small" / "x.bin",)
    assert (root / "small" / "x.bin").read_bytes() == CONTENT
    assert left_in(root) == ["small/x.bin"]
    assert seen[-1] == ("small/x.bin", len(CONTENT), len(CONTENT))
    assert fetch(facts, root).kept == first.downloaded
    assert len(owner.asked) == 1


def test_goes_on_where_it_broke_off(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    facts = small_set({}, items=[offered(owner, CONTENT)])
    owner.break_after = 300_000
    for _ in range(2):
        with pytest.raises(TwingapError, match="broke off after"):
            fetch(facts, tmp_path / "root")
    assert not (tmp_path / "root" / "small" / "x.bin").exists()
    owner.break_after = None
    fetch(facts, tmp_path / "root")
    assert (tmp_path / "root" / "small" / "x.bin").read_bytes() == CONTENT
    assert [asked for _, asked in owner.asked] == [None, "bytes=300000-", "bytes=600000-"]


def test_starts_anew_where_the_server_knows_no_ranges(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    facts = small_set({}, items=[offered(owner, CONTENT)])
    owner.break_after = 300_000
    with pytest.raises(TwingapError):
        fetch(facts, tmp_path / "root")
    owner.break_after, owner.ranges = None, False
    fetch(facts, tmp_path / "root")
    assert (tmp_path / "root" / "small" / "x.bin").read_bytes() == CONTENT


def test_what_is_not_the_owners_file_is_not_put_in_place(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    by_hash, by_size = offered(owner, CONTENT), offered(owner, CONTENT, "y.bin")
    blob = offered(owner, CONTENT, "z.bin", **{"twingap:gitBlobId": "0" * 40})
    del blob["sha256"]
    owner.files["/x.bin"] = CONTENT[:-1] + b"!"
    owner.files["/y.bin"] = CONTENT + b"!"
    for item in (by_hash, by_size, blob):
        root = tmp_path / Path(item["@id"]).stem
        with pytest.raises(TwingapError, match="is not what the manifest says"):
            fetch(small_set({}, items=[item]), root)
        assert left_in(root) == []


def test_an_altered_file_is_replaced_and_kept_until_then(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    facts = small_set({}, items=[offered(owner, CONTENT)])
    place = tmp_path / "root" / "small" / "x.bin"
    place.parent.mkdir(parents=True)
    place.write_bytes(b"altered")
    kept = owner.files.pop("/x.bin")
    with pytest.raises(TwingapError, match="404"):
        fetch(facts, tmp_path / "root")
    assert place.read_bytes() == b"altered"
    owner.files["/x.bin"] = kept
    fetch(facts, tmp_path / "root")
    assert place.read_bytes() == CONTENT


def test_a_file_known_by_git_blob_is_verified_by_it(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    blob = hashlib.sha1(b"blob %d\0" % len(CONTENT) + CONTENT).hexdigest()
    item = offered(owner, CONTENT, **{"twingap:gitBlobId": blob})
    del item["sha256"]
    assert fetch(small_set({}, items=[item]), tmp_path / "root").downloaded


def test_offline_is_one_line_and_leaves_nothing(small_set: Make, tmp_path: Path) -> None:
    item = {"@type": "cr:FileObject", "@id": "small/x", "contentUrl": "http://127.0.0.1:9/x", "sha256": "0" * 64}
    with pytest.raises(TwingapError, match="cannot be reached") as caught:
        fetch(small_set({}, items=[item]), tmp_path / "root")
    assert "\n" not in str(caught.value)
    assert "again" in str(caught.value)
    assert left_in(tmp_path / "root") == []
    assert not (tmp_path / "root").exists()


def zipped(contents: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return stream.getvalue()


RUNS = {"run1/1.csv": b"1", "run1/2.csv": b"2", "run2/1.csv": b"3"}


def archived(owner: Owner) -> list[dict[str, Any]]:
    inner = zipped({f"Inner set/{name}": content for name, content in RUNS.items()} | {"readme.txt": b"not wanted"})
    item = offered(owner, zipped({"10. Outer/inner.zip": inner, "10. Outer/again/inner.zip": inner}), "all.zip")
    files = {
        "@type": "cr:FileSet",
        "@id": "small/csv",
        "includes": "run*/*.csv",
        "containedIn": {"@id": "small/all.zip"},
        "twingap:fileCount": 3,
    }
    return [item, files]


def test_archives_within_archives_are_unpacked_where_readers_look(
    small_set: Make, owner: Owner, tmp_path: Path
) -> None:
    facts, root = small_set({}, items=archived(owner)), tmp_path / "root"
    assert fetch(facts, root).unpacked == 3
    assert left_in(root / "small") == ["all.zip", *RUNS]
    assert (root / "small" / "run2" / "1.csv").read_bytes() == b"3"
    # The archive may be thrown away then; and a lost file brings it back.
    (root / "small" / "all.zip").unlink()
    assert fetch(facts, root).unpacked == 0
    (root / "small" / "run1" / "2.csv").unlink()
    assert fetch(facts, root).unpacked == 3
    assert len(owner.asked) == 2


def test_a_set_got_by_hand_is_verified_and_unpacked(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    items = archived(owner)
    items[0]["contentUrl"] = "all.zip"
    facts = small_set({}, items=items, **{"twingap:howToGet": "ask the owner"})
    with pytest.raises(TwingapError, match="ask the owner"):
        fetch(facts, tmp_path)
    place = tmp_path / "small" / "all.zip"
    place.parent.mkdir()
    place.write_bytes(b"something else")
    with pytest.raises(TwingapError, match="is not the owner's file"):
        fetch(facts, tmp_path)
    place.write_bytes(owner.files["/all.zip"])
    assert fetch(facts, tmp_path).unpacked == 3


@pytest.mark.parametrize("name", ["virtual_cwru", "smart_maintenance", "xjtu_sy"])
def test_sets_that_no_program_can_download_say_what_to_do(name: str, tmp_path: Path) -> None:
    with pytest.raises(TwingapError) as caught:
        fetch(manifest_of(name), tmp_path)
    assert (manifest_of(name).how_to_get or "?") in str(caught.value)
    assert left_in(tmp_path) == []


def test_broken_and_foreign_archives_leave_nothing(tmp_path: Path) -> None:
    patterns = [FilePattern("small/run*/*.csv")]
    broken, foreign = tmp_path / "broken.zip", tmp_path / "foreign.zip"
    broken.write_bytes(zipped(RUNS)[:-30])
    foreign.write_bytes(zipped({"other.txt": b""}))
    for archive, said in ((broken, "cannot be unpacked"), (foreign, "holds none of")):
        with pytest.raises(TwingapError, match=said):
            unpack(archive, tmp_path / "small", "small", patterns)
        assert left_in(tmp_path / "small") == []


def test_an_archive_cannot_write_outside_its_set(tmp_path: Path) -> None:
    archive = tmp_path / "evil.zip"
    archive.write_bytes(zipped({"../../run1/1.csv": b"out", "/run2/2.csv": b"out"}))
    unpack(archive, tmp_path / "root" / "small", "small", [FilePattern("small/run*/*.csv")])
    assert left_in(tmp_path / "root") == ["small/run1/1.csv", "small/run2/2.csv"]
    assert left_in(tmp_path) == ["evil.zip", "root/small/run1/1.csv", "root/small/run2/2.csv"]


def test_unpackers_are_asked_for_before_a_long_download(
    small_set: Make, owner: Owner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    item = offered(owner, CONTENT, "x.zip", **{"twingap:holds": [".7z", ".rar"]})
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(TwingapError, match=r"no program for \.7z archives is installed; install one of 7z"):
        fetch(small_set({}, items=[item]), tmp_path / "root")
    assert owner.asked == []
    require_unpackers([".zip"])


def test_an_outside_unpacker_is_used_and_its_failure_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A stand-in for `unar`, called as the real one is: -output-directory FOLDER ARCHIVE come last.
    tools, archive = tmp_path / "tools", tmp_path / "x.rar"
    tools.mkdir()
    unar = tools / "unar"
    unar.write_text('#!/bin/sh\nmkdir -p "$5/run1" && echo 7 > "$5/run1/1.csv"\n', encoding="ascii")
    unar.chmod(unar.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    archive.write_bytes(b"Rar!")
    assert unpack(archive, tmp_path / "small", "small", [FilePattern("small/run*/*.csv")]) == 1
    assert (tmp_path / "small" / "run1" / "1.csv").read_text(encoding="ascii") == "7\n"
    unar.write_text("#!/bin/sh\necho no such method >&2\nexit 1\n", encoding="ascii")
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}/nowhere{os.pathsep}/bin")
    with pytest.raises(TwingapError, match=r"cannot be unpacked"):
        unpack(archive, tmp_path / "small2", "small", [FilePattern("small/run*/*.csv")])
    assert left_in(tmp_path / "small2") == []


def test_a_root_that_cannot_be_written_is_one_line(small_set: Make, owner: Owner, tmp_path: Path) -> None:
    (tmp_path / "root").write_text("a file", encoding="utf-8")
    with pytest.raises(TwingapError, match="cannot be written"):
        fetch(small_set({}, items=[offered(owner, CONTENT)]), tmp_path / "root")

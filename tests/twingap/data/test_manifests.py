"""The manifests of the public data sets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twingap.bearing import BEARINGS, FAULTS
from twingap.data import READERS, manifest_names, manifest_of
from twingap.data.manifest import CROISSANT, manifests_folder, read_manifest
from twingap.errors import TwingapError
from twingap.records import UNITS

NAMES = manifest_names()


def test_every_data_set_has_a_manifest_and_a_reader() -> None:
    wanted = {"cwru", "ims", "femto", "hit_sm", "xjtu_sy", "smart_maintenance", "virtual_cwru"}
    assert wanted <= set(NAMES)
    assert set(NAMES) == set(READERS)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # within mlcroissant
def test_is_valid_croissant(name: str) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    dataset = mlcroissant.Dataset(manifests_folder() / f"{name}.json")
    assert not dataset.metadata.ctx.issues.errors
    assert dataset.metadata.name == name


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # within mlcroissant
@pytest.mark.parametrize("name", NAMES)
def test_facts_can_be_read_as_croissant_records(name: str) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    facts = manifest_of(name)
    if not facts.recordings:
        pytest.skip(f"{name} states no recordings: they are made on demand")
    dataset = mlcroissant.Dataset(manifests_folder() / f"{name}.json")
    rows = list(dataset.records("recordings"))
    assert len(rows) == len(facts.recordings)


@pytest.mark.parametrize("name", NAMES)
def test_says_whose_it_is_and_what_may_be_done_with_it(name: str) -> None:
    facts = manifest_of(name)
    assert facts.name == name
    assert len(facts.licence) > 10
    assert len(facts.citation) > 10
    assert facts.url is None or facts.url.startswith("https://")
    assert facts.url or facts.how_to_get
    assert facts.unit in UNITS
    assert facts.bearing in BEARINGS


@pytest.mark.parametrize("name", NAMES)
def test_every_file_has_a_checksum_or_the_archive_that_holds_it_has(name: str) -> None:
    for file in manifest_of(name).files:
        assert file.path.startswith(f"{name}/")
        assert file.size_bytes, file.path
        assert file.checksum, file.path
        digits = file.checksum.split(":")[1]
        assert len(digits) == (64 if file.sha256 else 40)
        assert set(digits) <= set("0123456789abcdef")
        assert file.url or file.provenance or manifest_of(name).how_to_get, f"{file.path}: from where?"
        assert not (file.converted and file.url), f"{file.path}: a conversion is not the owner's"
    archives = {file.path for file in manifest_of(name).files}
    for pattern in manifest_of(name).patterns:
        assert pattern.contained_in is None or pattern.contained_in in archives


@pytest.mark.parametrize("name", NAMES)
def test_facts_are_ones_that_records_can_have(name: str) -> None:
    facts = manifest_of(name)
    for row in facts.recordings:
        assert row.get("fault", "healthy") in FAULTS
        assert set(row.get("end_fault", "outer").split("+")) <= set(FAULTS)
        assert row["fs_hz"] > 1000
        if "file" in row:
            assert facts.file(row["file"]) is not None, row["file"]


def test_cwru_covers_the_whole_design_and_knows_98_to_100_by_git_blob() -> None:
    facts = manifest_of("cwru")
    cells = {(row["fault"], row["fault_size_inch"], row["load_hp"]) for row in facts.recordings}
    assert len(cells) == len(facts.recordings) == 40
    for number in (98, 99, 100):
        file = facts.file(f"cwru/{number}.mat")
        assert file is not None
        assert file.sha256 is None
        assert file.git_blob
    stand_ins = {file.stands_in_for for file in facts.files if file.converted}
    assert stand_ins == {"cwru/98.mat", "cwru/99.mat"}


def test_published_counts_add_up() -> None:
    assert sum(row["n_snapshots"] for row in manifest_of("xjtu_sy").recordings) == 9216
    for name in ("xjtu_sy", "femto"):
        facts = manifest_of(name)
        assert sum(p.count or 0 for p in facts.patterns) == sum(row["n_snapshots"] for row in facts.recordings)


def test_no_manifest_names_a_machine() -> None:
    for name in NAMES:
        text = (manifests_folder() / f"{name}.json").read_text(encoding="utf-8")
        assert '"/' not in text  # an absolute path


@pytest.mark.data
def test_manifests_agree_with_the_list_of_checksums(real_root: Path) -> None:
    sums = real_root / "SHA256SUMS"
    if not sums.is_file():
        pytest.skip("the data root has no SHA256SUMS")
    lines = [line.split(maxsplit=1) for line in sums.read_text(encoding="utf-8").splitlines()]
    assert lines
    for digest, path in lines:
        file = manifest_of(path.split("/")[0]).file(path)
        assert file is not None, path
        assert file.sha256 == digest
        assert file.size_bytes == (real_root / path).stat().st_size


def _document(**changes: Any) -> dict[str, Any]:
    base = {
        "name": "x",
        "alternateName": "x",
        "description": "x",
        "license": "x",
        "citeAs": "x",
        "conformsTo": CROISSANT,
        "distribution": [],
    }
    return {key: value for key, value in (base | changes).items() if value is not None}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is not JSON"),
        ("[]", "is not a Croissant data set"),
        (json.dumps(_document(conformsTo="http://mlcommons.org/croissant/0.8")), "conformsTo"),
        (json.dumps(_document(license=None)), "'license' is missing"),
        (json.dumps(_document(distribution=[{"@type": "cr:FileObject"}])), "'@id' is missing"),
        (
            json.dumps(_document(distribution=[{"@type": "cr:FileObject", "@id": "a", "contentSize": "2 MB"}])),
            "invalid",
        ),
    ],
)
def test_a_broken_manifest_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "broken.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TwingapError, match=said) as caught:
        read_manifest(path)
    assert "broken.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(TwingapError, match="no data set 'cwr'; use one of cwru, femto"):
        manifest_of("cwr")


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(("cwru", "xjtu_sy", "ims")), value=JSON_VALUES, data=st.data())
def test_a_manifest_damaged_anywhere_is_read_or_refused_in_one_line(
    tmp_path: Path, name: str, value: Any, data: st.DataObject
) -> None:
    document = json.loads((manifests_folder() / f"{name}.json").read_text(encoding="utf-8"))
    place: Any = document
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.booleans()):
            place[key] = value
            break
        place = place[key]
    path = tmp_path / "damaged.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    try:
        read_manifest(path)
    except TwingapError as error:
        assert "damaged.json" in str(error)
        assert "\n" not in str(error)

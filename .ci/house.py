"""Install twingap once, and run a module there: what every tox environment does.

    python .ci/house.py EXTRA[,EXTRA...] -- MODULE [ARGUMENT ...]

tox gives each of its environments an installation of its own; torch and its kin are too large for that. So all of them
share one, made beside them in tox's work folder. Dependencies are installed again only when pyproject.toml or
constraints.txt changed or an extra is missing, the project itself only when its files changed. Environments that run at
the same time install one after the other.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import virtualenv
from filelock import FileLock

ROOT = Path(__file__).resolve().parent.parent
HOUSE = Path(os.environ.get("TOX_WORK_DIR", ROOT / ".tox")) / "house"
PYTHON = HOUSE / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
STAMP = HOUSE / "installed.json"
SOURCES = ("shared", "papers", "benchmarks", "data_manifests")


def digest(paths: list[Path]) -> str:
    """One sha256 over names and contents."""
    total = hashlib.sha256()
    for path in sorted(paths):
        total.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


def install(extras: set[str]) -> None:
    """Bring the shared installation up to date."""
    pins = [ROOT / "pyproject.toml", ROOT / "constraints.txt"]
    sources = [p for top in SOURCES for p in (ROOT / top).rglob("*") if p.is_file() and "__pycache__" not in p.parts]
    wanted = {"pins": digest(pins), "sources": digest(pins + sources), "extras": sorted(extras)}
    have = json.loads(STAMP.read_text()) if STAMP.exists() else {"pins": "", "sources": "", "extras": []}
    if not PYTHON.exists():
        virtualenv.cli_run([str(HOUSE), "--python", sys.executable])
        have = {"pins": "", "sources": "", "extras": []}
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    missing = extras - set(have["extras"]) if have["pins"] == wanted["pins"] else extras | set(have["extras"])
    if have["pins"] != wanted["pins"] or missing:
        print("installing twingap and what it needs (minutes the first time) ...", file=sys.stderr, flush=True)
        chosen = ",".join(sorted(missing))
        subprocess.run(
            [*pip, "-c", str(ROOT / "constraints.txt"), f"{ROOT}[{chosen}]" if chosen else str(ROOT)], check=True
        )
    if have["sources"] != wanted["sources"]:
        subprocess.run([*pip, "--force-reinstall", "--no-deps", str(ROOT)], check=True)
    wanted["extras"] = sorted(extras | set(have["extras"]))
    STAMP.write_text(json.dumps(wanted))


def main() -> int:
    """Install, then run the module with the shared installation's Python."""
    split = sys.argv.index("--")
    extras = {extra for word in sys.argv[1:split] for extra in word.split(",") if extra}
    HOUSE.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(HOUSE.with_suffix(".lock")):
        install(extras)
    return subprocess.run([str(PYTHON), "-m", *sys.argv[split + 1 :]]).returncode


if __name__ == "__main__":
    sys.exit(main())

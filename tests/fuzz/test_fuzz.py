"""Damaged and hostile inputs: a result or one line that names the file, and nothing else (more of it: `make fuzz`)."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from fuzz.contract import check, fuzz
from fuzz.limits import limited

from motionary.cli import main

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases" / "faults"


def test_mutations_of_every_format_keep_the_contract():
    """Three hundred seeds; each new kind of fault that is found elsewhere becomes a mutation."""
    tried = 0
    for number, faults in fuzz(first=0, count=300):
        tried += number
        assert not faults, faults
    assert tried == 300


def test_the_limits_are_measured(tmp_path):
    """A task that hangs, that swells, that fails, or that does not name its file is told."""
    file = tmp_path / "a.npz"
    assert "exit -27: " in limited(_hang, seconds=0.2).faults(file)
    assert any("MB" in fault for fault in limited(_swell).faults(file))
    assert "exit 1: ZeroDivisionError: division by zero" in limited(_fail).faults(file)
    assert limited(main, ["convert", str(file), str(tmp_path / "b.npz")]).faults(file) == []
    assert any("does not name" in fault or "names a.npz" in fault for fault in limited(_unnamed).faults(file))


@pytest.mark.real
def test_inputs_that_real_reports_led_to(tmp_path):
    """Each file of the shared faults, to npz, glb and html; each folder as a data root."""
    if not CASES.is_dir():
        pytest.skip("no shared cases of faults at ../shared/cases/faults")
    found = {}
    for path in sorted(CASES.iterdir()):
        if path.is_dir():
            found[path.name] = limited(_checked, path).faults(path)
            continue
        for extension in ("npz", "glb", "html"):
            target = tmp_path / f"{path.stem}.{extension}"
            outcome = limited(main, ["convert", str(path), str(target)])
            found[target.name] = outcome.faults(path)
            if outcome.code == 2:
                break  # it is refused before any writer is asked
    assert not {name: faults for name, faults in found.items() if faults}


def _checked(path: Path) -> int:
    with tempfile.TemporaryDirectory() as out:
        found = check(path, Path(out))
    print("\n".join(found))
    return 1 if found else 0


def _hang() -> None:
    while True:
        pass


def _swell() -> None:
    bytearray(1100 << 20)


def _fail() -> None:
    1 / 0  # noqa: B018


def _unnamed() -> int:
    print("error: something is wrong")
    return 2

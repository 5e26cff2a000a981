"""The presets of papers and released code are what docs/presets.md says."""

import re

import pytest
import yaml

from motionary.pipeline.params import write_params
from motionary.pipeline.tracking import flatten

ROW = re.compile(r"^\| `([\w.]+)` \| (\S+) \| ([^|]+) \| (\S+) \| ([^|]+) \|$")


def composed(repository, tmp_path, scale):
    write_params(repository, tmp_path / "params.yaml", [f"scale={scale}"])
    return yaml.safe_load((tmp_path / "params.yaml").read_text())


def tables(repository):
    """{(preset, key): value} of both tables."""
    found, names = {}, ()
    for line in (repository / "docs" / "presets.md").read_text().splitlines():
        if line.startswith("| key |"):
            names = [cell.strip() for cell in line.split("|")[2:5:2]]
        elif row := ROW.match(line):
            key, paper, source, released, other = row.groups()
            assert source.strip(), line
            assert other.strip(), line
            found |= {(names[0], key): yaml.safe_load(paper), (names[1], key): yaml.safe_load(released)}
    return found


@pytest.mark.parametrize("scale", ["paper", "released"])
def test_presets_are_the_table(repository, tmp_path, scale):
    expected = {key: value for (name, key), value in tables(repository).items() if name == scale}
    assert len(expected) > 100
    own = flatten(yaml.safe_load((repository / "conf" / "scale" / f"{scale}.yaml").read_text()))
    assert {key: own[key] for key in own if key != "scale"} == expected
    values = flatten(composed(repository, tmp_path, scale))
    assert {key: values[key] for key in expected} == expected
    # No clock of the small scale is left: what stops or moves a training is in the table.
    for section in {key.split(".")[0] for key in expected} - {"evaluation", "action_evaluation"}:
        assert {f"{section}.patience", f"{section}.validate_every"} <= expected.keys()


@pytest.mark.parametrize("scale", ["paper_kit", "released_kit"])
def test_presets_of_kit_differ_in_their_table_alone(repository, tmp_path, scale):
    expected = {key: value for (name, key), value in tables(repository).items() if name == scale}
    kit = flatten(composed(repository, tmp_path, scale))
    plain = flatten(composed(repository, tmp_path, scale.removesuffix("_kit")))
    assert {key: kit[key] for key in kit if kit[key] != plain[key]} == {**expected, "scale": scale}

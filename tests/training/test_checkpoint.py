"""A disk may damage checkpoints: training then goes on from the one before, or anew, to the very same weights."""

import sys
from pathlib import Path

import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))
from toy import Regression, batches, settings

from motionary.errors import InputError
from motionary.training.checkpoint import earlier, load_checkpoint
from motionary.training.devices import make_fabric
from motionary.training.loop import fit


def trained(checkpoint=None, stop=None):
    """The weights after a training that checkpoints every seventh of 40 steps, and what it logged."""
    model, config = Regression(), settings(ema_decay=0.9, patience=9)
    steps = []
    fabric = make_fabric("cpu")
    held = batches(config)
    fit(
        model, batches(config), held, config, fabric, checkpoint, log=lambda *row: steps.append(row[0]), stop_after=stop
    )
    return {name: value.numpy().tobytes() for name, value in model.state_dict().items()}, steps


def flip(place):
    """Turns one bit, `place` of the file's length from its beginning."""

    def damage(path):
        data = bytearray(path.read_bytes())
        data[int(place * (len(data) - 1))] ^= 4
        path.write_bytes(data)

    return damage


def cut(share):
    """Keeps the beginning of the file."""

    def damage(path):
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])

    return damage


DAMAGES = {
    "length of the header": flip(0.0),
    "header": flip(0.05),
    "weights": flip(0.5),
    "last byte": flip(1.0),
    "first half": cut(0.5),
    "all but the last bytes": cut(0.999),
    "empty": cut(0.0),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "text": lambda path: path.write_text("{}"),
}


@pytest.fixture(scope="module")
def unbroken():
    return trained()[0]


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damaged_checkpoint_is_dropped_and_the_one_before_taken(damage, unbroken, tmp_path, capfd):
    path = tmp_path / "c.safetensors"
    trained(path, stop=30)
    damage(path)
    weights, steps = trained(path)
    (line,) = (line for line in capfd.readouterr().err.splitlines() if "c.safetensors" in line)
    assert line.startswith(f"warning: {path}: ")
    assert line.endswith("damaged; it is dropped, training goes on from the one before")
    assert weights == unbroken
    assert min(steps) > 21  # 28 was damaged


def test_where_both_are_damaged_it_starts_anew(unbroken, tmp_path, capfd):
    path = tmp_path / "c.safetensors"
    trained(path, stop=30)
    flip(0.7)(path)
    cut(0.2)(earlier(path))
    weights, steps = trained(path)
    lines = [line for line in capfd.readouterr().err.splitlines() if line.startswith("warning")]
    assert [line.rsplit(", ", 1)[1] for line in lines] == [
        "training goes on from the one before",
        "training starts anew",
    ]
    assert weights == unbroken
    assert min(steps) < 21


def test_killed_between_two_names_it_goes_on_from_the_one_before(unbroken, tmp_path, capfd):
    path = tmp_path / "c.safetensors"
    trained(path, stop=30)
    path.unlink()  # the newest has become the earlier one, the next has not taken its place
    weights, steps = trained(path)
    assert weights == unbroken
    assert min(steps) > 21
    assert "warning" not in capfd.readouterr().err


def test_every_bit_counts(tmp_path):
    """Whatever bit is turned, the file is refused, or nothing that training takes from it has changed."""
    path = tmp_path / "c.safetensors"
    trained(path, stop=7)
    whole, model = path.read_bytes(), Regression()
    optimizer = torch.optim.AdamW(model.parameters())
    kept = load_checkpoint(path, model, optimizer)
    for place in range(0, len(whole), 97):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            extra, numbers = load_checkpoint(path, model, optimizer)
        except InputError:
            continue
        assert numbers == kept[1]
        assert all(torch.equal(value, extra[name]) for name, value in kept[0].items())

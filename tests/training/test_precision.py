"""Mixed precision acts in every system's loss, on one device and on several, and where it must not it does not."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch
from every_system import NAMES, batch_for, build_all, labeled
from safetensors.torch import load_file
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.flop_counter import flop_registry

sys.path.insert(0, str(Path(__file__).parent))
from mixed import Same, steps_of

from motionary.errors import InputError
from motionary.nn.quantizer import Quantizer
from motionary.nn.recurrent import BiGRU
from motionary.nn.unrolled import StepCell
from motionary.training.devices import make_fabric
from motionary.training.loop import fit


class Products(TorchDispatchMode):
    """Counts the operations of matrix products and convolutions by the type of their inputs."""

    def __init__(self):
        super().__init__()
        self.flops = {}

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        out = function(*args, **(kwargs or {}))
        count = flop_registry.get(function._overloadpacket)
        if count is not None:
            flops = count(*args, **(kwargs or {}), out_val=out)
            kind = next(a for a in args if isinstance(a, torch.Tensor)).dtype
            self.flops[kind] = self.flops.get(kind, 0) + flops
        return out


@pytest.fixture(scope="module")
def small(context, tmp_path_factory):
    """Every system, small; a head that starts at zero is moved, since it tells the same in any precision."""
    models = dict(build_all(labeled(context), tmp_path_factory.mktemp("small")))
    torch.nn.init.constant_(models["masked_autoregression"].head.output.weight, 0.1)
    return models


def count_products(model):
    """Products of each loss that `model` computes from here on, by type."""
    found, original = [], model.loss

    def loss(*arguments):
        with Products() as products:
            result = original(*arguments)
        found.append(products.flops)
        return result

    model.loss = loss
    return found


@pytest.mark.parametrize("name", NAMES)
def test_products_of_every_loss_are_narrow(small, context, name):
    model, batch = small[name], batch_for(labeled(context), small[name])
    start = {key: value.clone() for key, value in model.state_dict().items()}
    losses = {}
    for precision in ("32", "bf16-mixed"):
        model.load_state_dict(start)
        found = count_products(model)
        history = fit(model, Same(batch), None, steps_of(1), make_fabric("cpu", precision))
        del model.loss
        losses[precision] = history.train[0]["loss"]
        narrow, wide = (found[0].get(kind, 0) for kind in (torch.bfloat16, torch.float32))
        assert (narrow > 2 * wide) if precision != "32" else narrow == 0, (precision, found)
    assert losses["bf16-mixed"] == pytest.approx(losses["32"], rel=0.03)
    assert losses["bf16-mixed"] != losses["32"]
    moved = [key for key, p in model.named_parameters() if p.requires_grad and not torch.equal(p, start[key])]
    assert moved
    assert all(p.dtype == torch.float32 and bool(p.isfinite().all()) for p in model.parameters())


def test_two_processes_in_mixed_precision_hold_equal_weights(tmp_path):
    """Of every system: its buffers, as the tokenizer's codebook, too."""
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    script = Path(__file__).with_name("mixed.py")
    done = subprocess.run([*command, str(script), str(tmp_path)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    for name in NAMES:
        first, second = (load_file(tmp_path / f"{name}{rank}.safetensors") for rank in (0, 1))
        for key, value in first.items():
            assert torch.equal(value, second[key]), f"{name}: {key}"
            assert bool(value.isfinite().all()), f"{name}: {key}"


def test_codes_do_not_depend_on_precision():
    quantizer, latents = Quantizer(64, 16), torch.randn(500, 16, generator=torch.Generator().manual_seed(0))
    quantizer.start(latents, torch.Generator().manual_seed(1))
    exact = quantizer.nearest(latents)
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(quantizer.nearest(latents), exact)
        mask = torch.ones(1, 500, dtype=torch.bool)
        quantized, codes, *losses = quantizer(latents[None].bfloat16(), mask)
    assert (codes[0] == exact).float().mean() > 0.9  # the latents themselves were rounded here
    assert {x.dtype for x in (quantized, *losses, quantizer.sums)} == {torch.float32}


def test_recurrence_under_autocast_is_that_of_32_bits():
    torch.manual_seed(0)
    unit, cell = BiGRU(8, 6), StepCell(8, 6)
    x, lengths = torch.randn(3, 5, 8), torch.tensor([2, 5, 4])
    exact, state = unit(x, lengths), cell(x[:, 0], torch.ones(3, 6))
    with torch.autocast("cpu", torch.bfloat16):
        near, stepped = unit(x, lengths), cell(x[:, 0], torch.ones(3, 6))
    for a, b in zip((*exact, state), (*near, stepped), strict=True):
        assert b.dtype == torch.float32
        assert torch.allclose(a, b, atol=0.02)
        assert not torch.equal(a, b)
    assert torch.equal(near[0] == 0, exact[0] == 0)  # padding


@pytest.mark.parametrize("wrong", ["16-mixed", 64, True])
def test_other_precisions_are_refused(wrong):
    with pytest.raises(InputError, match=r"precision: .*must be one of auto, 32, bf16-mixed"):
        make_fabric("cpu", wrong)


@pytest.mark.parametrize(("has_units", "named"), [(True, "bf16-mixed"), (False, "32-true")])
def test_auto_is_narrow_where_the_processor_has_units_for_it(monkeypatch, has_units, named):
    monkeypatch.setattr(torch.cpu, "_is_amx_tile_supported", lambda: has_units)
    assert make_fabric("cpu", "auto")._precision.precision == named
    assert make_fabric("cpu", 32)._precision.precision == "32-true"


@pytest.mark.parametrize(
    ("known", "asked", "told"), [(False, "bf16-mixed", True), (True, "bf16-mixed", False), (False, "auto", False)]
)
def test_bfloat16_that_the_processor_does_not_know_is_told(monkeypatch, capsys, known, asked, told):
    monkeypatch.setattr(torch.cpu, "_is_amx_tile_supported", lambda: False)
    monkeypatch.setattr(torch.cpu, "_is_avx512_bf16_supported", lambda: known)
    fabric = make_fabric("cpu", asked)
    assert fabric._precision.precision == ("32-true" if asked == "auto" else asked)
    said = capsys.readouterr().err
    assert ("precision=auto" in said and said.count("\n") == 1) if told else not said

import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

sys.path.insert(0, str(Path(__file__).parent))
from toy import Numbers, Regression, batches, settings

from motionary.corpus.batches import Batches
from motionary.errors import InputError
from motionary.systems.trainable import Trainable
from motionary.training.devices import make_fabric
from motionary.training.loading import ahead
from motionary.training.loop import fit, validate
from motionary.training.schedule import peak_factor, rate


@pytest.fixture(scope="module")
def fabric():
    return make_fabric("cpu")


def validation():
    return Batches(Numbers(32, seed=1), 16, shuffle=False)


def trained(fabric, checkpoint=None, stops=(None,), **changes):
    config = settings(**changes)
    for stop in stops:
        model = Regression()
        history = fit(model, batches(config), validation(), config, fabric, checkpoint, stop_after=stop)
    return model, history


def test_training_lowers_the_loss(fabric):
    before = validate(Regression(), validation(), "cpu")["loss"]
    model, history = trained(fabric, steps=200)
    assert validate(model, validation(), "cpu")["loss"] < 0.1 * before
    assert history.validation[-1]["step"] == 200


@pytest.mark.parametrize("changes", [{}, {"ema_decay": 0.9}, {"patience": 3}])
def test_a_killed_run_ends_with_the_weights_of_an_unbroken_one(fabric, tmp_path, changes):
    unbroken, whole = trained(fabric, **changes)
    # Killed at steps that are not checkpoints: up to six steps are lost and done again.
    resumed, pieces = trained(fabric, tmp_path / "c.safetensors", stops=(10, 26, None), **changes)
    for name, value in unbroken.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    assert pieces.validation == whole.validation
    assert pieces.train == whole.train


def test_the_same_seed_repeats_and_another_does_not(fabric):
    config = settings()
    runs = []
    for seed in (0, 0, 1):
        model = Regression()
        fit(model, batches(config), None, config, fabric, seed=seed)
        runs.append(model.state_dict()["net.0.weight"])
    assert torch.equal(runs[0], runs[1])
    assert not torch.equal(runs[0], runs[2])


def test_early_stopping_keeps_the_best_weights(fabric):
    config = settings(
        steps=400, learning_rate=0.5, schedule="constant", patience=4, validate_every=3, max_grad_norm=0.0
    )
    model = Regression(noise=3.0)
    history = fit(model, batches(config), validation(), config, fabric)
    best = min(row["loss"] for row in history.validation)
    assert history.stopped_early
    assert history.validation[-1]["step"] < 400
    assert validate(model, validation(), "cpu")["loss"] == pytest.approx(best, rel=1e-6)


def test_average_of_weights_is_what_is_kept(fabric):
    config = settings(ema_decay=0.5, steps=1, warmup_steps=0)
    model = Regression()
    start = {name: p.detach().clone() for name, p in model.named_parameters()}
    plain = Regression()
    fit(plain, batches(config), None, settings(steps=1, warmup_steps=0), fabric)
    fit(model, batches(config), None, config, fabric)
    # After one step the decay is min(0.5, 2 / 11).
    for name, p in model.named_parameters():
        stepped = dict(plain.named_parameters())[name]
        assert torch.allclose(p, start[name] + (1 - 2 / 11) * (stepped - start[name]), atol=1e-6)


@pytest.mark.parametrize(("factor", "told"), [(float("nan"), "nan"), (1e9, "[0-9.]+e.0[89]"), (-1e9, None)])
def test_a_loss_that_runs_away_ends_the_training(fabric, factor, told):
    """From step 40 on it is no number, or huge; a negative one only falls."""

    class Jumping(Regression):
        def loss(self, batch, progress, generator):
            loss, values = super().loss(batch, progress, generator)
            return loss * (factor if progress >= 0.5 else 1.0), values

    config = settings(steps=80, log_every=10)
    given = (batches(config), validation(), config, fabric)
    if told is None:
        assert fit(Jumping(), *given).train[-1]["loss"] < -1e7
        return
    with pytest.raises(InputError, match=rf"codec: a loss of {told}.* at step 50 \(.* at step 10\): .*max_grad_norm"):
        fit(Jumping(), *given, description="codec")


def test_rate_closed_form():
    config = settings(steps=105, warmup_steps=5)
    assert [rate(config, s) for s in (0, 4)] == [0.2, 1.0]
    assert rate(config, 5) == 1.0
    assert rate(config, 55) == pytest.approx(0.505)
    assert rate(config, 105) == pytest.approx(0.01)
    assert rate(settings(schedule="constant"), 39) == 1.0
    assert all(math.isfinite(rate(settings(warmup_steps=40), s)) for s in range(41))


def test_hooks_and_progress(fabric):
    model, history = trained(fabric, steps=10, log_every=1)
    assert model.seen == 10
    assert [row["progress"] for row in history.train] == pytest.approx([i / 10 for i in range(10)])


class OnlyALoss(Trainable):
    def __init__(self):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(6, 2))
        self.frozen = torch.nn.Parameter(torch.ones(1), requires_grad=False)

    def loss(self, batch, progress, generator):
        x, y = batch.motion[:, 0].split([6, 2], dim=1)
        drawn = torch.rand((), generator=generator)
        return (x @ self.weight - y).square().mean(), {"drawn": drawn, "progress": torch.tensor(progress)}


def test_a_loss_is_enough_to_be_trained(fabric):
    """Validation is then the loss at the end of the training, with the same draws every time."""
    config = settings(steps=100, learning_rate=0.1, max_grad_norm=0.0, weight_decay=0.0)
    model = OnlyALoss()
    history = fit(model, batches(config), validation(), config, fabric)
    assert history.validation[-1]["loss"] < 0.05 * history.train[0]["loss"]
    assert {row["progress"] for row in history.validation} == {1.0}
    assert len({row["drawn"] for row in history.validation}) == 1
    assert model.frozen.item() == 1
    with pytest.raises(TypeError, match=r"abstract method .*loss"):
        Trainable()  # pyright: ignore[reportAbstractUsage]


@pytest.fixture(scope="module")
def in_two(tmp_path_factory):
    """What toy.py, run as two processes, leaves: the weights of both by name, and its folder."""
    folder = tmp_path_factory.mktemp("two")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    toy = Path(__file__).parent / "toy.py"
    done = subprocess.run([*command, str(toy), str(folder)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    return lambda name: [load_file(folder / f"{name}{rank}.safetensors") for rank in (0, 1)], folder


def test_two_processes_train_as_one_with_twice_the_batch(fabric, in_two):
    first, second = in_two[0]("plain")
    config = settings(batch_size=8)
    single = Regression(dropout=0.0, noise=0.0)
    fit(single, batches(config), None, config, fabric)
    for name, value in single.named_parameters():
        assert torch.equal(first[name], second[name])
        assert torch.allclose(first[name], value, atol=2e-5), name


def test_a_second_process_resumes_where_the_first_does(in_two):
    """It has a folder of its own, where no checkpoint lies, and dropout of its own."""
    weights, folder = in_two
    assert (folder / "cache0" / "toy.safetensors").exists()
    assert not (folder / "cache1").exists()
    unbroken, resumed = weights("unbroken"), weights("resumed")
    for name, value in unbroken[0].items():
        assert all(torch.equal(value, other[name]) for other in (unbroken[1], *resumed)), name


def test_codes_restart_alike_in_both_processes(in_two):
    """Dead codes, drawn from what the first process saw, lie where both can use them: the codebooks stay equal."""
    first, second = in_two[0]("codes")
    for name, value in first.items():
        if name.startswith("quantizer."):
            assert torch.equal(value, second[name]), name
    assert first["restarted"] == second["restarted"] > 0
    assert first["used"] > first["used_before"]


@pytest.mark.parametrize(("scale", "factor"), [("none", 1), ("sqrt", 2), ("linear", 4)])
def test_rate_of_four_processes(scale, factor):
    assert peak_factor(settings(scale_rate=scale), 4) == factor
    assert peak_factor(settings(scale_rate=scale), 1) == 1


def test_epochs_are_counted_in_steps():
    """11 batches of 8 make 1.1 epochs of 80 items; two processes need half as many."""
    config = settings(epochs=1.1, validate_every=0)
    assert (config.over(80).steps, config.over(80).validate_every) == (11, 10)
    assert (config.over(80, world=2).steps, config.over(80, world=2).validate_every) == (6, 5)
    assert settings().over(80) == settings()


def test_batches_made_ahead_are_the_same_in_order():
    made = []

    def items():
        for i in range(20):
            made.append(i)
            yield i

    reader = ahead(items(), 3)
    assert next(reader) == 0
    waited = time.monotonic()
    while len(made) < 4 and time.monotonic() - waited < 10:
        time.sleep(0.01)
    assert 4 <= len(made) <= 5  # three wait, and one may be in the thread's hands
    assert list(reader) == list(range(1, 20))


def test_a_batch_that_fails_is_an_error_where_it_would_have_come():
    def items():
        yield 1
        raise OSError("gone")

    reader = ahead(items())
    assert next(reader) == 1
    with pytest.raises(OSError, match="gone"):
        next(reader)


def test_no_thread_stays_behind_a_reader_that_stops():
    before = threading.active_count()
    reader = ahead(iter(range(10**9)))
    assert next(reader) == 0
    assert threading.active_count() == before + 1
    reader.close()
    assert threading.active_count() == before


@pytest.mark.parametrize(("asked", "told", "used"), [(0, "1", 1), (2, "1", 2)])
def test_several_processes_can_share_the_cores(asked, told, used):
    code = "from motionary.training import devices; devices.set_threads({}); print(devices.torch.get_num_threads())"
    command = [sys.executable, "-c", code.format(asked)]
    done = subprocess.run(
        command, env={**os.environ, "OMP_NUM_THREADS": told}, capture_output=True, text=True, check=True
    )
    assert int(done.stdout) == used

"""Stylization in use: content motions, and a style from a label, a reference, a code or the prior (thesis Fig. 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import torch
from torch import Tensor

from motionary.errors import InputError
from motionary.features import UNIT
from motionary.nn.convolutions import coarser, keep
from motionary.nn.layers import length_mask
from motionary.nn.noise import normal_noise
from motionary.nn.padding import by_length, pad
from motionary.systems.stylization.global_motion import GlobalMotion
from motionary.systems.stylization.stylizer import STRIDE, Stylizer


class StyleTransfer:
    """The trained stylizers of one folder of models and the global motion predictor. Features are raw on both sides.

    Args:
        stylizers: by setting, "supervised" and "unsupervised" or one of them.
        global_motion: gives the root's velocities.
        batch_size: motions of a forward pass; they are sorted by length, so that padding costs little.

    Attributes:
        styles: known labels; a label id is a position in them.
        fps: of contents, references and results.
        window: frames that style was learned on.
        receptive: frames of the shortest reference.
        context: of the models.
    """

    def __init__(self, stylizers: dict[str, Stylizer], global_motion: GlobalMotion, batch_size: int = 32):
        if not stylizers:
            raise InputError("stylization", "none", "needs a trained setting; run `dvc repro stylization`")
        self.stylizers = {setting: model.eval() for setting, model in stylizers.items()}
        self.global_motion, self.batch_size = global_motion.eval(), batch_size
        some = next(iter(stylizers.values()))
        self.context, self.receptive, self.window = some.context, some.receptive, some.config.window
        self.styles: tuple[str, ...] = tuple(self.context.styles)
        self.fps = float(self.context.fps)
        self.device = next(global_motion.parameters()).device

    def model(self, setting: str) -> Stylizer:
        """The stylizer of a setting; InputError where it was not trained."""
        if setting not in self.stylizers:
            rule = f"must be one of {', '.join(self.stylizers)}"
            if setting == "supervised":
                rule = "was not trained: the corpus has no style labels; give a reference, or neither it nor a style"
            raise InputError("setting", setting, rule)
        return self.stylizers[setting]

    @torch.no_grad()
    def stylize(
        self,
        contents: Sequence[np.ndarray],
        *,
        setting: str,
        seeds: Sequence[int],
        labels: Sequence[int] | None = None,
        references: Sequence[np.ndarray] | None = None,
        codes: Tensor | None = None,
        strength: float = 1.0,
        predict_root: bool = True,
    ) -> list[np.ndarray]:
        """Each content in a style: of its label with a code drawn from the prior (label-based), of its reference
        (motion-based; "supervised" wants the label too), or, without either, of a code drawn from the prior.

        Args:
            contents: raw features (T, D) of any lengths.
            setting: "supervised" or "unsupervised".
            seeds: one a content, of the prior's draws.
            labels: style ids, one a content; "supervised" needs them, "unsupervised" refuses them.
            references: raw features of style motions, one a content, at least `receptive` frames each.
            codes: (N, D_s) style codes in place of references and draws.
            strength: how far to go from the content's codes to the stylized ones: 0 gives the content back as the
                autoencoder knows it, 1 the stylized motion, more exaggerates. (Not in the thesis.)
            predict_root: False copies the content's root velocities ("w/o GMP", Table 5.7).

        Returns:
            raw features (T, D) float32, as long as the contents. No result depends on the other contents.
        """
        model = self.model(setting)
        if not np.isfinite(strength) or strength < 0:
            raise InputError("strength", strength, "must be a number of at least 0")
        label = self._labels(model, labels, len(contents))
        if codes is None and references is not None:
            codes = torch.from_numpy(self.style_codes(references, setting=setting, labels=labels))
        if codes is None:
            codes = normal_noise(seeds, 1, model.config.style_dim)[:, 0]
        style = model.generator.style(codes.to(self.device), label)
        return self.generate(contents, style, setting=setting, strength=strength, predict_root=predict_root)

    @torch.no_grad()
    def generate(
        self,
        contents: Sequence[np.ndarray],
        style: Tensor,
        *,
        setting: str,
        strength: float = 1.0,
        predict_root: bool = True,
    ) -> list[np.ndarray]:
        """Each content in the style (N, W) of :meth:`style`, whose rows may be mixtures of styles."""
        model, results = self.model(setting), cast(list[np.ndarray], [None] * len(contents))
        for rows in by_length([len(c) for c in contents], self.batch_size):
            whole = [_whole(contents[i]) for i in rows]
            made = self._batch(model, whole, style[torch.as_tensor(rows)], strength, predict_root)
            for row, features in zip(rows, made, strict=True):
                results[row] = features[: len(contents[row])].copy()
        return results

    @torch.no_grad()
    def style(self, codes: Tensor, labels: Sequence[int] | None, setting: str) -> Tensor:
        """(N, W) what the generator reads of style codes (N, D_s) and labels; rows may be mixed linearly."""
        model = self.model(setting)
        return model.generator.style(codes.to(self.device), self._labels(model, labels, len(codes)))

    @torch.no_grad()
    def style_codes(
        self, motions: Sequence[np.ndarray], *, setting: str, labels: Sequence[int] | None = None
    ) -> np.ndarray:
        """(N, D_s) float32 means of the style spaces of raw features (T, D), each at least `receptive` frames."""
        model, label = self.model(setting), self._labels(self.model(setting), labels, len(motions))
        for motion in motions:
            if len(motion) < self.receptive:
                rule = f"must last at least {self.receptive} frames, {self.receptive / self.fps:.2f} s: one step of"
                raise InputError("reference", f"{len(motion)} frames", f"{rule} the style encoder sees as many")
        found = np.zeros((len(motions), model.config.style_dim), np.float32)
        for rows in by_length([len(m) for m in motions], self.batch_size):
            raw, frames = pad([motions[i][: len(motions[i]) // STRIDE * STRIDE] for i in rows])
            codes, mask = self._encode(model, raw, frames)
            chosen = None if label is None else label[torch.as_tensor(rows)]
            found[rows] = model.style_encoder(codes, chosen, mask)[0].cpu().numpy()
        return found

    def _batch(
        self, model: Stylizer, whole: list[np.ndarray], style: Tensor, strength: float, predict_root: bool
    ) -> np.ndarray:
        raw, frames = pad(whole)
        codes, mask = self._encode(model, raw, frames)
        made = model.generator(model.content_encoder(codes, mask), style, coarser(mask))
        if strength != 1:
            made = codes + strength * (keep(made, mask) - codes)
        frames = frames.to(self.device)
        local = model.latents.decode(made, frames // UNIT)
        root = self.global_motion(local, frames) if predict_root else model.latents.root(raw.to(self.device))
        return model.latents.raw(root, local).float().cpu().numpy()

    def _encode(self, model: Stylizer, raw: Tensor, frames: Tensor) -> tuple[Tensor, Tensor | None]:
        frames = frames.to(self.device)
        codes = model.latents.encode(model.latents.local(raw.to(self.device)), frames)
        if bool((frames == frames[0]).all()):
            return codes, None
        return codes, length_mask(frames // UNIT, codes.shape[-1])[:, None].to(codes.dtype)

    def _labels(self, model: Stylizer, labels: Sequence[int] | None, count: int) -> Tensor | None:
        if not model.config.labels:
            if labels is not None:
                raise InputError("labels", list(labels)[:3], "unsupervised stylization knows no labels")
            return None
        if labels is None or len(labels) != count:
            raise InputError("labels", labels, f"supervised stylization needs one style label a motion, {count}")
        if not all(0 <= label < len(self.styles) for label in labels):
            raise InputError("labels", list(labels)[:3], f"must be positions in {', '.join(self.styles)}")
        return torch.as_tensor(list(labels), device=self.device)


def _whole(features: np.ndarray) -> np.ndarray:
    """Features whose last frame is repeated up to whole steps of content."""
    if features.ndim != 2 or not len(features):
        raise InputError("content", features.shape, "must be features (T, D) with T >= 1")
    return np.concatenate([features, features[-1:].repeat(-len(features) % STRIDE, 0)]).astype(np.float32)

"""The four pose decoders of Fig. 3.4: what a hidden state says of a frame, as a pose of `motionary.nn.poses`."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from motionary.features.lie import ForwardKinematics
from motionary.motion import Skeleton
from motionary.nn.poses import ROOT

SLOPE = 0.2  # of the leaky rectifier


class PlainDecoder(nn.Module):
    """Fig. 3.4 (a): the joints straight from the hidden state. Bones need not keep their lengths."""

    aligns = False

    def __init__(self, hidden: int, skeleton: Skeleton, upstream: int):
        super().__init__()
        self.out = nn.Linear(hidden, 3 * len(skeleton))

    def forward(self, hidden: Tensor, before: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """Poses (B, S, 3 J) of hidden states (B, S, h).

        Args:
            hidden: of the generator.
            before: (B, S, 3 J) the pose before each frame.
            state: of the decoder's own recurrence where it has one, None at the start.
        """
        return self.out(hidden), state


class LieDecoder(nn.Module):
    """Fig. 3.4 (b): Lie algebra vectors and the root side by side; joints by forward kinematics (Eq. 3.4)."""

    aligns = False
    further = ROOT  # numbers beside the vectors

    def __init__(self, hidden: int, skeleton: Skeleton, upstream: int):
        super().__init__()
        self.vectors = 3 * len(skeleton)
        self.out = nn.Linear(hidden, self.vectors + (self.further or upstream))
        self.kinematics = ForwardKinematics(skeleton)

    def forward(self, hidden: Tensor, before: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """As :meth:`PlainDecoder.forward`."""
        local, rest = self._local(hidden)
        return torch.cat([rest, local], -1), state

    def _local(self, hidden: Tensor) -> tuple[Tensor, Tensor]:
        """Joints relative to the root (B, S, 3 J - 3), and what else the hidden state says."""
        vectors, rest = self.out(hidden).split([self.vectors, self.out.out_features - self.vectors], -1)
        return self.kinematics(vectors.unflatten(-1, (-1, 3)))[..., 1:, :].flatten(-2), rest


class GlobalFromLocalDecoder(LieDecoder):
    """Fig. 3.4 (c), GLMI-M: the root's movement from two local poses by an MLP (Eq. 3.9), after the pose itself.

    Eq. 3.9 predicts three velocities; here the vertical one is the height, which would drift if it were summed up.
    """

    aligns = True
    further = 0

    def __init__(self, hidden: int, skeleton: Skeleton, upstream: int):
        super().__init__(hidden, skeleton, upstream)
        self.read = nn.Linear(2 * (self.vectors - 3) + upstream, hidden)
        self.move = nn.Linear(hidden, ROOT)

    def forward(self, hidden: Tensor, before: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """As :meth:`PlainDecoder.forward`."""
        local, upstream = self._local(hidden)
        read, state = self._remember(self.read(torch.cat([local, before[..., ROOT:], upstream], -1)), state)
        return torch.cat([self.move(nn.functional.leaky_relu(read, SLOPE)), local], -1), state

    def _remember(self, read: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor | None]:
        return read, state


class RecurrentGlobalDecoder(GlobalFromLocalDecoder):
    """Fig. 3.4 (d), GLMI-R: as GLMI-M, with a GRU that remembers the path so far."""

    def __init__(self, hidden: int, skeleton: Skeleton, upstream: int):
        super().__init__(hidden, skeleton, upstream)
        self.memory = nn.GRU(hidden, hidden, batch_first=True)

    def _remember(self, read: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor | None]:
        return self.memory(read, state)


DECODERS = {
    "plain": PlainDecoder,
    "lie": LieDecoder,
    "glmi_m": GlobalFromLocalDecoder,
    "glmi_r": RecurrentGlobalDecoder,
}

"""What a model knows of its data: where the codec keeps what, and the one unit of all networks."""

import dataclasses

import numpy as np
import pytest

from motionary.errors import InputError


def test_columns_are_the_codec_s(corpus):
    context = corpus.context
    assert context.columns("root_angular", "root_linear") == slice(0, 3)
    assert context.columns("root_linear", "root_angular") == [1, 2, 0]
    assert context.other_columns("root_angular", "root_linear") == slice(3, context.dim)
    assert context.seen_columns(hide_contacts=False) == slice(0, context.dim)
    frames = np.asarray(corpus.features(0))
    contacts = frames[:, context.columns("contacts")]
    assert set(np.unique(contacts)) <= {0.0, 1.0}
    np.testing.assert_array_equal(
        np.concatenate([frames[:, context.seen_columns(hide_contacts=True)], contacts], 1), frames
    )
    with pytest.raises(InputError, match="fingers: must be one of the codec's groups, root_angular"):
        context.columns("fingers")


def test_another_unit_than_the_networks_is_refused(corpus):
    with pytest.raises(InputError, match=r"context\.unit: 8: must be 4"):
        dataclasses.replace(corpus.context, unit=8)

"""Accuracy over items and over classes."""

import numpy as np
import pytest

from motionary.errors import InputError
from motionary.metrics import accuracy, macro_accuracy


def test_closed_forms():
    """Nine of one class right and one of another wrong: 90% of the items, half of the classes."""
    labels = np.array([0] * 9 + [1])
    predicted = np.zeros(10, int)
    assert accuracy(predicted, labels) == pytest.approx(0.9)
    assert macro_accuracy(predicted, labels) == pytest.approx(0.5)
    assert macro_accuracy(predicted, labels, [0]) == 1
    assert macro_accuracy(predicted, labels, [1, 7]) == 0
    assert macro_accuracy(labels, labels) == accuracy(labels, labels) == 1


def test_bad_input():
    with pytest.raises(InputError, match="as many ids"):
        accuracy([1, 2], [1])
    with pytest.raises(InputError, match="as many ids"):
        accuracy([], [])
    with pytest.raises(InputError, match="some of the classes"):
        macro_accuracy([1], [1], [2])

"""The one error that bad input raises, and the check of configuration values."""

from types import SimpleNamespace

import pytest

from motionary.errors import InputError, check_values


def test_the_first_value_that_breaks_the_rule_is_named():
    config = SimpleNamespace(width=3, depth=0, height=-1)
    check_values("house", config, ("width",), lambda v: v >= 1, "must be at least 1")
    with pytest.raises(InputError) as caught:
        check_values("house", config, ("width", "depth", "height"), lambda v: v >= 1, "must be at least 1")
    assert str(caught.value) == "house.depth: 0: must be at least 1"

"""The one error that bad input raises, and the check of configuration values."""

import tracemalloc
from types import SimpleNamespace

import pytest

from motionary.errors import InputError, check_values, check_whole, shortened


def test_the_first_value_that_breaks_the_rule_is_named():
    config = SimpleNamespace(width=3, depth=0, height=-1)
    check_values("house", config, ("width",), lambda v: v >= 1, "must be at least 1")
    with pytest.raises(InputError) as caught:
        check_values("house", config, ("width", "depth", "height"), lambda v: v >= 1, "must be at least 1")
    assert str(caught.value) == "house.depth: 0: must be at least 1"


@pytest.mark.parametrize("part", ["value", "what"])
def test_a_long_text_is_cut_before_it_is_made_printable(part):
    """A file of megabytes of control characters took seconds and a gigabyte to be refused."""
    long = "\x01" * 4_000_000
    tracemalloc.start()
    error = InputError(*(("file", long) if part == "value" else (long, "value")), "must be text")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1_000_000
    assert len(str(error)) < 1200
    assert str(error).isprintable()


def test_a_value_is_shown_whole_where_it_fits_and_cut_where_not():
    assert shortened("a\n b\x01") == "a b\\x01"
    assert shortened("x" * 120) == "x" * 120
    assert shortened("x" * 121) == "x" * 117 + "..."
    assert shortened(" " * 20_000 + "x").endswith("...")


@pytest.mark.parametrize("value", [11, 2**70, 0, True, 1.0])
def test_a_count_has_a_least_and_a_most(value):
    check_whole("n", 1, 1, 10)
    check_whole("n", 10, 1, 10)
    check_whole("n", 2**70, 1)
    with pytest.raises(InputError, match=r"must be a whole number, at least 1, at most 10$"):
        check_whole("n", value, 1, 10)

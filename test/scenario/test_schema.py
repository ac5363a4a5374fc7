# SPDX-License-Identifier: Apache-2.0
"""Configuration blocks: conversion, and errors of invalid values."""

import array
import math
from dataclasses import dataclass

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import describe, key, load


@dataclass(frozen=True)
class Sample:
    """One key of each type."""

    mass: float = key("Mass [kg]", positive=True)
    share: float = key("Share", 0.5, minimum=0.0, maximum=1.0)
    count: int = key("Count", 3, minimum=1)
    active: bool = key("Whether", True)
    kind: str = key("Kind", "soft", choices=("soft", "stiff"))
    title: str = key("Title", "", live=True)
    gains: tuple[float, ...] = key("Gains", (), minimum=0.0)
    names: tuple[str, ...] = key("Names", (), choices=("x", "y", "z"))


def test_values_are_converted_and_defaults_fill_the_rest():
    """Integers become floats, lists become tuples, and omitted keys have their defaults."""
    sample = load(Sample, {"mass": 2, "gains": [1, 2.5], "names": ["y", "x"]})
    assert sample == Sample(2.0, gains=(1.0, 2.5), names=("y", "x"))
    assert type(sample.mass) is float
    assert all(type(gain) is float for gain in sample.gains)


@pytest.mark.parametrize("values", [np.array([1.0, 2.0]), array.array("d", [1.0, 2.0]), (1, 2)])
def test_arrays_are_lists_too(values):
    """Lists of numbers may come as arrays, as ROS gives them."""
    gains = load(Sample, {"mass": 1.0, "gains": values}).gains
    assert gains == (1.0, 2.0)
    assert type(gains[0]) is float


@pytest.mark.parametrize(
    ("name", "value", "found", "allowed"),
    [
        ("mass", "heavy", "'heavy'", "a number"),
        ("mass", True, "True", "a number"),
        ("mass", None, "None", "a number"),
        ("mass", [1.0], "[1.0]", "a number"),
        ("mass", 0.0, "0.0", "a number > 0"),
        ("mass", 0, "0", "a number > 0"),
        ("mass", -1, "-1", "a number > 0"),
        ("mass", math.nan, "nan", "a number > 0"),
        ("mass", math.inf, "inf", "a number > 0"),
        ("share", 1.5, "1.5", "a number >= 0 and <= 1"),
        ("share", -0.1, "-0.1", "a number >= 0 and <= 1"),
        ("count", 2.0, "2.0", "a whole number"),
        ("count", True, "True", "a whole number"),
        ("count", 0, "0", "a whole number >= 1"),
        ("active", 1, "1", "true or false"),
        ("active", "yes", "'yes'", "true or false"),
        ("title", 5, "5", "a text"),
        ("kind", "stif", "'stif'", "stiff | soft"),
        ("kind", "", "''", "soft | stiff"),
        ("gains", 1.0, "1.0", "a list of numbers"),
        ("gains", "1.0", "'1.0'", "a list of numbers"),
        ("gains", np.float64(1.0), "1.0", "a list of numbers"),
        ("gains", [1.0, "a"], "[1.0, 'a']", "a number"),
        ("gains", [1.0, False], "[1.0, False]", "a number"),
        ("gains", [1.0, -2.0], "[1.0, -2.0]", "a number >= 0"),
        ("gains", [1.0, math.nan], "[1.0, nan]", "a number >= 0"),
        ("gains", np.array([1.0, -2.0]), "[1.0, -2.0]", "a number >= 0"),
        ("names", "xy", "'xy'", "a list of names"),
        ("names", ["x", 3], "['x', 3]", "a text"),
        ("names", ["w"], "['w']", "x | y | z"),
    ],
)
def test_a_wrong_value_is_refused_with_key_found_and_allowed(name, value, found, allowed):
    """The error names the full key, what was found and what is allowed."""
    with pytest.raises(ScenarioError) as caught:
        load(Sample, {"mass": 1.0} | {name: value}, "block")
    error = caught.value
    assert (error.key, str(error.found), error.allowed) == (f"block.{name}", found, allowed)
    assert str(error) == f"block.{name}: found {found}, allowed: {allowed}"


def test_limits_themselves_are_allowed():
    """Bounds are inclusive, except where a number must be positive."""
    assert load(Sample, {"mass": 1e-300, "share": 1.0, "count": 1, "gains": [0]}).share == 1.0
    assert load(Sample, {"mass": 1.0, "share": 0}).share == 0.0


def test_an_unknown_key_is_answered_with_the_nearest_known_one():
    """A misspelt key is refused; the key that was meant heads the list of all."""
    with pytest.raises(ScenarioError) as caught:
        load(Sample, {"mass": 1.0, "gain": [1.0]}, "block")
    assert caught.value.key == "block.gain"
    assert caught.value.found == "an unknown key"
    assert caught.value.allowed.startswith("gains | mass | share")


@pytest.mark.parametrize("name", [True, 1, None, 2.5])
def test_a_key_that_is_no_text_is_unknown(name):
    """YAML reads the keys `on` and `1` as no texts; they are refused like any unknown key."""
    with pytest.raises(ScenarioError, match=f"{name}: found an unknown key"):
        load(Sample, {"mass": 1.0, name: 3})


def test_a_missing_key_is_named_with_its_type():
    """A key without default must be given."""
    with pytest.raises(ScenarioError) as caught:
        load(Sample, {}, "block")
    assert str(caught.value) == "block.mass: found nothing, allowed: a number (required)"


def test_keys_of_other_blocks_are_ignored():
    """Ignored keys are neither read nor rejected."""
    assert load(Sample, {"mass": 1.0, "other": object()}, ignore=("other",)).mass == 1.0


def test_a_long_value_is_cut():
    """A wrong value of many numbers is shown in part."""
    with pytest.raises(ScenarioError) as caught:
        load(Sample, {"mass": 1.0, "gains": [-1.0] * 500})
    assert len(str(caught.value.found)) <= 80


def test_a_file_heads_the_message():
    """A known file starts the message."""
    error = ScenarioError("a.b", 3, "a text", "team.yaml")
    assert str(error) == "team.yaml: a.b: found 3, allowed: a text"


def test_describe_gives_every_key_with_its_rule_and_value():
    """Type, range, meaning and value of each key come from the one declaration."""
    found = {path: (hint, rule, value) for path, hint, rule, value in describe(Sample(2.0), "b")}
    assert list(found)[:2] == ["b.mass", "b.share"]
    assert len(found) == 8
    hint, rule, value = found["b.share"]
    assert (hint, rule.minimum, rule.maximum, rule.live, value) == (float, 0.0, 1.0, False, 0.5)
    assert found["b.title"][1].live


def test_one_of_starts_with_the_closest():
    """The name that was probably meant comes first, the others keep their order."""
    assert one_of(["human", "autonomy", "hold"], "hodl") == "hold | human | autonomy"
    assert one_of(["b", "a"], "unlike") == "b | a"
    assert one_of([]) == "none"

"""The list of nodes of a composed process."""

import pytest

from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.node import Node

NODE = "crazyflie_utils.node:Node"


@pytest.fixture
def kind():
    return NODE_CLASSES


def test_names_and_classes(kind):
    assert kind({"a": NODE, "b": NODE}) == {"a": Node, "b": Node}


def test_names_with_namespaces_are_trees_on_the_parameter_server(kind):
    assert kind({"cf1": {"simulator": NODE, "deep": {"er": NODE}}, "b": NODE}) == {
        "cf1/simulator": Node,
        "cf1/deep/er": Node,
        "b": Node,
    }


def test_order_is_kept(kind):
    assert list(kind({"b": NODE, "a": NODE, "c": {"d": NODE}})) == ["b", "a", "c/d"]


@pytest.mark.parametrize("value", [{}, None, [], "a", [NODE], 3])
def test_other_types_are_refused(kind, value):
    with pytest.raises(ValueError):
        kind(value)
    assert str(kind) == 'a dictionary of node name: "package.module:Class"'


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("crazyflie_utils.node:Nobody", "no class 'crazyflie_utils.node:Nobody': AttributeError"),
        ("no_such_module:Node", "no class 'no_such_module:Node': ModuleNotFoundError"),
        ("crazyflie_utils.node", "no class"),
        (":Node", "no class"),
        ("", "no class"),
        (7, "no class 7"),
        ("math:pi", "'math:pi' is not a subclass of Node"),
        ("builtins:int", "'builtins:int' is not a subclass of Node"),
    ],
)
def test_bad_paths_are_named(kind, path, reason):
    with pytest.raises(ValueError, match=reason):
        kind({"a": NODE, "b": path})


@pytest.mark.parametrize("name", ["", "two words", "1st"])
def test_bad_names_are_refused(kind, name):
    with pytest.raises(ValueError):
        kind({name: NODE})

"""Settings in a YAML file: declared parameters, and errors with file and line.

For lists of many similar entries, such as the vehicles of a fleet, which do not fit the
parameter server. An entry may merge others (``<<: *other``)::

    for name, entry in yaml_file.load("lab.yaml")["boxes"].entries().items():
        boxes[name] = entry.read(BoxParameters)
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from typing_extensions import override

from crazyflie_utils.parameters.declaration import Complaints, ParameterError, Parameters
from crazyflie_utils.parameters.types import ParameterType, checked
from crazyflie_utils.text import DECIMAL, HEXADECIMAL, number_from_text, shortened, shown
from crazyflie_utils.text_file import TextFileError, read_text, user_path

MAX_SIZE = 1_000_000  #: Largest file (bytes): three times that of a thousand vehicles.
MAX_DEPTH = 50  #: Largest number of nested lists and mappings.
MAX_NODES = 50_000  #: Largest number of values and keys, with aliases expanded.


class _Loader(yaml.SafeLoader):
    def __init__(self, text: str, name: str):
        super().__init__(text)
        self.name = name  # Name of the file in the marks of its nodes.
        self._depth = 0
        self._count = 0
        self._sizes: dict[int, int] = {}

    @override
    def compose_node(self, parent: Any, index: Any) -> yaml.Node:
        event, before = self.peek_event(), self._count
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._error(event, f"is nested too deeply; expected at most {MAX_DEPTH} levels")
        node = super().compose_node(parent, index)
        self._depth -= 1
        is_alias = isinstance(event, yaml.AliasEvent)
        if is_alias and id(node) not in self._sizes:
            alias = f"the alias *{shortened(event.anchor)}"
            raise self._error(event, f"has {alias} within the node to which it refers")
        self._count += self._sizes[id(node)] if is_alias else 1
        self._sizes[id(node)] = self._count - before
        if self._count > MAX_NODES:
            raise self._error(event, f"has too many values; expected at most {MAX_NODES}")
        return node

    def _error(self, event, reason):
        return _error(self.name, event.start_mark.line + 1, reason)

    @override
    def compose_mapping_node(self, anchor: str) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        merges = [value for key, value in node.value if key.tag == _MERGE]
        own = [pair for pair in node.value if pair[0].tag != _MERGE]
        if len(merges) > 1:
            raise self._error(node, "has << twice in a mapping; expected it once, with a list")
        for merge in merges:
            sources = merge.value if isinstance(merge, yaml.SequenceNode) else [merge]
            node.value = [*self._merged(sources, own), *own]
        return node

    def _merged(self, sources, own):
        """Return the pairs of mappings whose keys are not in ``own``, nor in an earlier mapping."""
        taken = {_key(pair) for pair in own}
        pairs = []
        for source in sources:
            if not isinstance(source, yaml.MappingNode):
                raise self._error(source, "is not a mapping; << expects one, or a list of them")
            source.is_merged = True
            pairs += [pair for pair in source.value if _key(pair) not in taken]
            taken.update(map(_key, source.value))
        return pairs


def _key(pair):
    # Keys that are not texts or numbers are refused later.
    return pair[0].value if isinstance(pair[0], yaml.ScalarNode) else id(pair[0])


_MERGE = "tag:yaml.org,2002:merge"
_INT, _FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"

# Numbers are those of `number_from_text`. YAML 1.1 reads 1e-3 as a text, 010 as 8 and 1:30 as 90.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in (_INT, _FLOAT)]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _tag, _pattern, _first in (
    (_INT, f"[+-]?[0-9]+|{HEXADECIMAL}", "+-0123456789"),
    (_FLOAT, DECIMAL, "+-.0123456789"),
    (_FLOAT, r"[+-]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", "+-."),
):
    _Loader.add_implicit_resolver(_tag, re.compile(f"(?:{_pattern})$"), list(_first))


class _Constructor(yaml.constructor.SafeConstructor):
    @override
    def construct_yaml_int(self, node: yaml.Node) -> int:
        word = self.construct_scalar(node)
        return int(word, 16 if re.fullmatch(HEXADECIMAL, word) else 10)

    @override
    def construct_yaml_float(self, node: yaml.Node) -> float:
        # YAML's infinity is .inf, and its NaN is .nan.
        return number_from_text(re.sub(r"\.(?=[a-zA-Z])", "", self.construct_scalar(node)))


_Constructor.add_constructor(_INT, _Constructor.construct_yaml_int)
_Constructor.add_constructor(_FLOAT, _Constructor.construct_yaml_float)


P = TypeVar("P", bound=Parameters)


def load(path: str | Path) -> "Entry":
    """Return the content of a file, which is a mapping; see `user_path`.

    `ParameterError`: it cannot be read, is not a YAML mapping, has a key twice, exceeds the limits
    above, or has an alias within the node to which the alias refers.
    """
    try:
        text = read_text(path, MAX_SIZE)
    except TextFileError as error:
        raise _error(path, error.line, error) from None
    return parse(text, user_path(path))


def parse(text: str, name: str | Path) -> "Entry":
    """Return the content of a text, which is a mapping; ``name`` is for errors. See `load`."""
    try:
        loader = _Loader(text, str(name))
        node = loader.get_single_node()
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        reason = f"is not valid YAML: it has the character U+{error.character:04X}"
        raise _error(name, line, reason) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        problem = shortened(error.problem or str(error))
        raise _error(name, mark and mark.line + 1, f"is not valid YAML: {problem}") from None
    loader.dispose()
    if node is None:
        raise ParameterError(f"{name}: is empty; expected a mapping")
    entry = Entry("", node)
    entry.entries()
    return entry


def _error(name, line, reason):
    where = shortened(str(name)) if line is None else f"{name}:{line}"
    return ParameterError(f"{where}: {reason}")


def _is_template(node):
    if not isinstance(node, yaml.MappingNode) or not node.value:
        return False
    return getattr(node, "is_merged", False) or all(_is_template(each) for _, each in node.value)


def _refuse(entry, known):
    raise entry.error(f"is not known; expected one of {', '.join(sorted(known))}")


@dataclass(frozen=True)
class Entry:
    """A value in a file, and its place, which is part of each `ParameterError`."""

    name: str  #: Keys from the top of the file, such as "boxes/table"; empty for the whole file.
    node: yaml.Node  #: The parser's node.

    @property
    def file(self) -> Path:
        """Name of the file that contains it."""
        return Path(self.node.start_mark.name)

    @property
    def line(self) -> int:
        """Number of its first line, from 1."""
        return self.node.start_mark.line + 1

    @property
    def value(self) -> Any:
        """The value by YAML's rules, which refuse some texts, such as a date in a 13th month.

        Numbers are those of `number_from_text`.
        """
        try:
            return _Constructor().construct_document(self.node)
        except (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError) as error:
            # PyYAML raises LookupError or AttributeError for a text that does not fit its tag.
            raise self.error(f"cannot be read: {shortened(str(error))}") from None

    @property
    def is_template(self) -> bool:
        """Whether it is there for others, which merge it by ``<<``, or only contains such ones."""
        return _is_template(self.node)

    def error(self, text: str) -> ParameterError:
        """Return an error about the entry: file, line and name, then the text."""
        return ParameterError(f"{self.file}:{self.line}: {self._title()} {text}")

    def checked(self, expected: ParameterType) -> Any:
        """Return the value of a type; the error says what it is, and what was expected."""
        try:
            return checked(expected, self.value)
        except ValueError as error:
            raise self.error(str(error)) from None

    def entries(self) -> dict[str, "Entry"]:
        """Return the entries of a mapping by key; keys must be different strings."""
        if not isinstance(self.node, yaml.MappingNode):
            raise self.error(f"is {shown(self.value)}; expected a mapping")
        found: dict[str, Entry] = {}
        for key_node, node in self.node.value:
            key = Entry(self.name, key_node).value
            if not isinstance(key, str):
                raise Entry(self.name, key_node).error(
                    f"has the key {shown(key)}; expected a string"
                )
            entry = Entry(f"{self.name}/{key}".lstrip("/"), node)
            if key in found:
                raise entry.error(f"occurs twice, first in line {found[key].line}")
            found[key] = entry
        return found

    def elements(self) -> list["Entry"]:
        """Return the elements of a list, in order."""
        if not isinstance(self.node, yaml.SequenceNode):
            raise self.error(f"is {shown(self.value)}; expected a list")
        return [Entry(f"{self.name}[{index}]", node) for index, node in enumerate(self.node.value)]

    def __contains__(self, key: str) -> bool:
        return key in self.entries()

    def __getitem__(self, key: str) -> "Entry":
        entries = self.entries()
        if key not in entries:
            raise self.error(f"has no {key}; it has {shortened(', '.join(entries)) or 'nothing'}")
        return entries[key]

    def read(
        self,
        parameters: type[P],
        extra_keys: tuple[str, ...] = (),
        on_unknown: Callable[["Entry", set[str]], None] = _refuse,
    ) -> P:
        """Return the parameters in a mapping; those of a group are in a mapping of their own.

        Keys in ``extra_keys``, which are read elsewhere, and templates are also accepted. The error
        lists everything that is missing, unknown or invalid. ``on_unknown(entry, known)`` is called
        with each entry that is unknown, and raises the error unless it is accepted.
        """
        names = {declaration.name for declaration in parameters.declarations()}
        known: dict[str, Entry] = {}
        complaints = Complaints()
        for path, entry in self._leaves(names):
            if path in names:
                known[path] = entry
            elif path not in extra_keys and not entry.is_template:
                with complaints:
                    on_unknown(entry, names | set(extra_keys))

        def place(name: str) -> str:
            entry = known.get(name, self)
            return f"{shortened(f'{self.name}/{name}'.lstrip('/'))} ({self.file}:{entry.line})"

        try:
            result = parameters.read(lambda name: known[name].value, place)
        except ParameterError as error:
            complaints += [self._with_place(text) for text in error.complaints]
        complaints.raise_any()
        return result

    def _leaves(self, names: set[str], prefix: str = "") -> Iterator[tuple[str, "Entry"]]:
        for key, entry in self.entries().items():
            path = prefix + key
            is_group = any(name.startswith(path + "/") for name in names)
            if is_group and path not in names:
                yield from entry._leaves(names, path + "/")
            else:
                yield path, entry

    def _with_place(self, complaint: str) -> str:
        # An error about a combination of values does not contain their place.
        if str(self.file) in complaint:
            return complaint
        return f"{self.file}:{self.line}: {self._title()}: {complaint}"

    def _title(self) -> str:
        return shortened(self.name) or "the file"

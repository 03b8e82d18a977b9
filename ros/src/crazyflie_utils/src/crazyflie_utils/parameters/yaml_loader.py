"""PyYAML's parser, with limits: what is no file of settings is refused at once.

Without them a few thousand brackets take seconds, and a few lines of aliases of aliases stand for
more than a computer holds.
"""

from typing import Any

import yaml
from typing_extensions import override

from crazyflie_utils.messages import shortened
from crazyflie_utils.text_input import TextFileError

MAX_SIZE = 1_000_000  #: Bytes of a file: a fleet of a thousand vehicles has a third of it.
MAX_DEPTH = 50  #: Lists and mappings inside each other.
MAX_NODES = 50_000  #: Values and keys; an alias counts as what it stands for.


def compose(text: str, name: str) -> yaml.Node | None:
    """Return the node of a YAML text; None for one without content. ``name`` is its file's.

    Raises `TextFileError` if it is no YAML, is beyond the limits above, or has an alias in what the
    alias stands for.
    """
    try:
        loader = _Loader(text, name)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        reason = f"is no YAML: it has the character U+{error.character:04X}"
        raise TextFileError(reason, line) from None
    try:
        return loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        problem = shortened(error.problem or str(error))
        raise TextFileError(f"is no YAML: {problem}", mark and mark.line + 1) from None
    finally:
        loader.dispose()


class _Loader(yaml.SafeLoader):
    def __init__(self, text: str, name: str):
        super().__init__(text)
        self.name = name  # In the marks of its nodes.
        self._depth = 0
        self._count = 0
        self._sizes: dict[int, int] = {}

    @override
    def compose_node(self, parent: Any, index: Any) -> yaml.Node:
        event = self.peek_event()
        before = self._count
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise _refusal(f"is nested too deep; expected at most {MAX_DEPTH} levels", event)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if not isinstance(event, yaml.AliasEvent):
            self._count += 1
            self._sizes[id(node)] = self._count - before
        elif id(node) in self._sizes:
            self._count += self._sizes[id(node)]
        else:
            raise _refusal(f"has the alias *{shortened(event.anchor)} in what it stands for", event)
        if self._count > MAX_NODES:
            raise _refusal(f"holds too much; expected at most {MAX_NODES} values", event)
        return node


def _refusal(reason, event):
    return TextFileError(reason, event.start_mark.line + 1)

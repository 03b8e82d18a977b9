"""Mutants of a module: copies that differ in one expression or statement of a function.

Left out is what a test need not see: texts of errors and logs, ``__repr__``, type hints, numbers up
to `ROUNDING`. Constants of modules, defaults of arguments and fields of classes are left out, too:
they are evaluated while the module is imported, see `crazyflie_dev.mutate`.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType
from typing import Any

#: Numbers up to this one only absorb rounding; a tenth more of them changes nothing.
ROUNDING = 1e-6

_OPERATORS: dict[type, type] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
}  # fmt: skip

_PAIRS = "min max, minimum maximum, fmin fmax, any all, sin cos, asin acos, floor ceil"
_SWAPPED = {
    word: other
    for pair in _PAIRS.split(", ")
    for word, other in (pair.split(), reversed(pair.split()))
}

#: Functions that are dropped: their first argument stands in place of the call.
_DROPPED = {"radians", "degrees", "deg2rad", "rad2deg", "abs", "fabs", "clip", "wrap_to_pi"}

_TEXTS = {"format", "debug", "info", "warn", "warning", "error", "exception", "critical"}
_SHORT = (ast.expr, ast.keyword, ast.Return, ast.Assign, ast.AugAssign)
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass(frozen=True)
class Mutant:
    """A module with one change in one function.

    Attributes
    ----------
    path : Path
        The module.
    function : str
        Qualified name of the outermost function around the change.
    first_line : int
        The line where its code begins, decorators included.
    line : int
        The line of the change.
    before, after : str
        The expression or statement around the change.
    """

    path: Path
    function: str
    first_line: int
    line: int
    before: str
    after: str
    _tree: ast.Module = field(repr=False)
    _slot: tuple[Any, Any, ast.AST] = field(repr=False)  # Container, key in it, new node.

    def code(self) -> CodeType:
        """Return the compiled code of the changed function."""
        container, key, new = self._slot
        old, container[key] = container[key], new
        try:
            module = compile(ast.fix_missing_locations(self._tree), str(self.path), "exec")
        finally:
            container[key] = old
        wanted = self.function, self.first_line
        return next(c for c in _codes(module) if (c.co_qualname, c.co_firstlineno) == wanted)

    def __str__(self) -> str:
        """Return the change without the line, as lists of explained mutants name it."""
        return f"{self.path.name} {self.function}: `{self.before} -> {self.after}`"


def mutants(path: Path) -> list[Mutant]:
    """Return the mutants of a module, in the order of its lines."""
    tree = ast.parse(path.read_text())
    found = []
    for function, name in _functions(tree, ""):
        first_line = min(each.lineno for each in [function, *function.decorator_list])
        for slot, line in _changes(function):
            before, after = _texts(*slot)
            slot = slot[:2] + slot[3:]
            found.append(Mutant(path, name, first_line, line, before, after, tree, slot))
    return sorted(found, key=lambda mutant: mutant.line)


def _codes(code: CodeType) -> Iterator[CodeType]:
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield constant
            yield from _codes(constant)


def _functions(node: ast.AST, prefix: str) -> Iterator[tuple[Any, str]]:
    """Yield the outermost functions with their qualified names."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, _FUNCTIONS):
            is_overload = any(_name(each) == "overload" for each in child.decorator_list)
            if child.name not in ("__repr__", "__str__") and not is_overload:
                yield child, prefix + child.name
        elif isinstance(child, ast.ClassDef):
            yield from _functions(child, f"{prefix}{child.name}.")
        elif isinstance(child, ast.stmt):
            yield from _functions(child, prefix)


def _name(node: Any) -> str:
    """Return the last name of ``a`` or ``x.a``, also of a call of it; else an empty text."""
    node = node.func if isinstance(node, ast.Call) else node
    return getattr(node, "attr", getattr(node, "id", ""))


def _changes(function):
    """Yield (container, key, parent, new node) and the line of each change in a function."""
    is_bool = _name(function.returns) == "bool"
    for container, key, node, parent in list(_slots(function)):
        line = getattr(node, "lineno", getattr(parent, "lineno", function.lineno))
        for new in _replacements(node, parent, is_bool):
            yield (container, key, parent, new), line


def _slots(parent):
    """Yield container, key, node and parent of all nodes below one that may be changed."""
    for name, value in ast.iter_fields(parent):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        is_list = isinstance(value, list)
        container = value if is_list else vars(parent)
        for key, child in list(enumerate(value)) if is_list else [(name, value)]:
            if isinstance(child, ast.AST) and not _is_text(child):
                yield container, key, child, parent
                if not isinstance(child, ast.Raise):
                    yield from _slots(child)


def _is_text(node):
    """Return whether a node is a text, writes one, or declares arguments."""
    is_call = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    return (
        isinstance(node, (ast.JoinedStr, ast.arguments))
        or (isinstance(node, ast.Constant) and isinstance(node.value, str))
        or (is_call and _name(node) in _TEXTS)
    )


def _replacements(node: Any, parent: Any, is_bool: bool) -> Iterator[ast.AST]:
    """Yield what may stand in place of a node; is_bool: in a function that returns a bool."""
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)) if value == 0.0 or abs(value) > ROUNDING:
            yield ast.Constant(float(f"{1.1 * value:.9g}") or 1.0)
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield node.operand
        case ast.Name(id=name) if name in _SWAPPED:
            yield ast.Name(_SWAPPED[name], node.ctx)
        case ast.Attribute(attr=name) if name in _SWAPPED:
            yield ast.Attribute(node.value, _SWAPPED[name], node.ctx)
        case ast.Call(args=[first, *_]) if _name(node) in _DROPPED:
            yield first
        case ast.Raise():
            yield ast.Pass()
        case ast.Return(value=ast.expr() as value) if is_bool:
            yield ast.Return(ast.UnaryOp(ast.Not(), value))
        case _ if type(node) in _OPERATORS and not _adds_texts(parent):
            yield _OPERATORS[type(node)]()
    if isinstance(parent, ast.If) and node is parent.test and _refuses(parent.body):
        yield ast.Constant(False)


def _adds_texts(node):
    return isinstance(node, ast.BinOp) and (_is_text(node.left) or _is_text(node.right))


def _refuses(body):
    """Return whether a branch leaves its function or loop; one that only raises loses that."""
    is_only_raise = len(body) == 1 and isinstance(body[0], ast.Raise)
    return (
        isinstance(body[-1], (ast.Return, ast.Continue, ast.Break, ast.Raise)) and not is_only_raise
    )


def _texts(container, key, parent, new):
    """Return the text before and after a change; of its parent if its own says too little."""
    old = container[key]
    if isinstance(old, ast.Raise):
        return f"raise {_name(old.exc)}".strip(), "pass"
    is_little = isinstance(old, (ast.Constant, ast.Name, ast.Attribute)) or type(old) in _OPERATORS
    if not (is_little and isinstance(parent, _SHORT)):
        return ast.unparse(old), ast.unparse(new)
    before = ast.unparse(parent)
    container[key] = new
    after = ast.unparse(parent)
    container[key] = old
    return before, after

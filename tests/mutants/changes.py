"""What may go wrong at one place of an equation."""

import ast
from collections.abc import Iterator

FUNCTIONS = {
    "sin": "cos", "cos": "sin", "tanh": "sin", "maximum": "minimum", "minimum": "maximum",
    "floor": "ceil", "abs": "negative", "sqrt": "square", "cbrt": "sqrt",
}  # fmt: skip
SWAPPED = FUNCTIONS | {  # names and fields that a slip of the pen exchanges
    "deflection": "rate", "rate": "deflection", "angle": "speed", "speed": "angle",
    "command": "speed", "load": "speed", "roll": "spin", "spin": "roll", "shaft": "spin",
    "stiffness": "damping", "damping": "stiffness", "preload": "stiffness",
    "mount_rate": "approach_rate", "approach_rate": "mount_rate",
    "normal": "drive", "drive": "normal", "contact": "mount", "mount": "contact",
    "friction": "damping", "momentum": "approach", "velocity": "displacement",
    "inverse": "matrix", "matrix": "inverse", "inertia": "mass", "mass": "inertia",
    "normal_force": "friction", "angular_velocity": "gravity", "gravity": "angular_velocity",
    "values": "slopes", "slopes": "values",
}  # fmt: skip
OTHER_PORT = {  # a law that acts elsewhere
    "shape": "surface", "surface": "shape", "contact": "mount", "separation": "contact",
    "mount": "contact", "shaft": "rolling", "rolling": "shaft", "sphere": "platform",
    "platform": "sphere", "kinematics": "shaft", "sensor": "platform", "radius": "kinematics",
    "command": "actuator", "actuator": "command",
}  # fmt: skip


def changes(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """What may go wrong at one node."""
    if isinstance(node, ast.BinOp):
        flipped = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
        kinds = {ast.Add: "sign", ast.Sub: "sign", ast.Mult: "factor", ast.Div: "factor"}
        if type(node.op) in flipped:
            yield (
                kinds[type(node.op)],
                ast.BinOp(node.left, flipped[type(node.op)](), node.right),
            )
        if isinstance(node.op, ast.Pow):
            raised = ast.BinOp(node.right, ast.Add(), ast.Constant(1))
            yield "exponent", ast.BinOp(node.left, ast.Pow(), raised)
        for side in ("left", "right"):
            part = getattr(node, side)
            if isinstance(part, ast.Constant) and isinstance(part.value, (int, float)):
                if isinstance(node.op, ast.Pow) or part.value == 0:
                    continue
                doubled = {side: ast.Constant(2 * part.value)}
                both = {"left": node.left, "right": node.right} | doubled
                yield "factor", ast.BinOp(both["left"], node.op, both["right"])
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        if not isinstance(node.operand, ast.Constant):
            yield "sign", node.operand
    elif isinstance(node, ast.Attribute) and node.attr in SWAPPED:
        yield (
            "function" if node.attr in FUNCTIONS else "port",
            ast.Attribute(node.value, SWAPPED[node.attr], node.ctx),
        )
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        if node.func.attr == "cross":
            yield "sign", ast.Call(node.func, node.args[::-1], [])
        elif node.func.attr == "at" and getattr(node.args[0], "value", None) in OTHER_PORT:
            port = ast.Constant(OTHER_PORT[node.args[0].value])
            yield "port", ast.Call(node.func, [port], [])


SILENT = (ast.Raise, ast.Assert)  # what stands in them is a message
SHAPES = {"shape", "ones_like", "zeros_like", "len"}  # of what stands in them only the shape counts


def shape_alone(node: ast.AST) -> bool:
    """Whether only the shape of what stands in `node` counts."""
    name = node.func if isinstance(node, ast.Call) else node
    return getattr(name, "attr", getattr(name, "id", None)) in SHAPES


def places(body: list[ast.stmt]) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Every expression's place: (parent, field, index)."""
    stack: list[ast.AST] = list(body)
    while stack:
        node = stack.pop()
        if shape_alone(node):
            continue
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "slice", "decorator_list", "defaults", "ctx"):
                continue
            for i, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
                if isinstance(child, ast.expr):
                    yield node, field, i
                if isinstance(child, ast.AST) and not isinstance(child, SILENT):
                    stack.append(child)


def put(parent, field, index, node):
    if index is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[index] = node


def mutants_of(tree: ast.FunctionDef) -> Iterator[tuple[str, str, ast.FunctionDef]]:
    """(kind, what it reads then, the changed function)."""
    for parent, field, index in list(places(tree.body)):
        old = getattr(parent, field) if index is None else getattr(parent, field)[index]
        for kind, new in changes(old):
            put(parent, field, index, new)
            yield kind, f"{ast.unparse(old)}  ->  {ast.unparse(new)}", tree
            put(parent, field, index, old)
    for statement in ast.walk(tree):
        if isinstance(statement, (ast.Return, ast.Assign)) and negated(statement.value):
            old = statement.value
            statement.value = ast.UnaryOp(ast.USub(), old)
            yield "sign", f"{ast.unparse(old)}  ->  -(...)", tree
            statement.value = old


def negated(value) -> bool:
    """Whether an opposite sign of a whole value is a slip worth trying: of a product, of a call."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute):
        return value.func.attr not in ("zeros", "zeros_like", "eye", "at", "set")
    return isinstance(value, ast.BinOp) and not isinstance(value.op, (ast.Add, ast.Sub))

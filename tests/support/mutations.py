"""How strong the tests are: `make mutations` changes one operator at a time and runs the default tests of its module.

Of all operators of the product, some are drawn by a seed. A mutation is killed where a test fails; those that live are
printed with their lines. The tests are those that `make test-changed` runs, so that others may kill it. Nothing else
may write to the working tree meanwhile.
"""

import ast
import random
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this is a program, too

from support.changed import ROOMS, ROOT, select

_SWAPPED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "+": "-", "-": "+", "*": "/", "/": "*"}
_SWAPPED |= {"and": "or", "or": "and"}
_SYMBOL: dict[type[ast.AST], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_SYMBOL |= {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.And: "and", ast.Or: "or"}
_LIMIT = 600.0
"""Wall time of the tests of one, s: a mutation may loop for ever, and is killed then."""


@dataclass(frozen=True)
class Mutation:
    """An operator of a line that becomes another one: file, relative to the root; line; columns in bytes; both."""

    file: Path
    line: int
    columns: tuple[int, int]
    old: str

    @property
    def new(self) -> str:
        """What it becomes."""
        return _SWAPPED[self.old]

    def applied(self, source: bytes) -> bytes:
        """Return the file's content with it."""
        lines, (begin, end) = source.split(b"\n"), self.columns
        line = lines[self.line - 1]
        between = line[begin:end].replace(self.old.encode(), self.new.encode())
        lines[self.line - 1] = line[:begin] + between + line[end:]
        return b"\n".join(lines)

    def __str__(self) -> str:
        text = (ROOT / self.file).read_text(encoding="utf-8").split("\n")[self.line - 1].strip()
        return f"{self.file}:{self.line}: {self.old} -> {self.new}: {text}"


def mutations(file: Path) -> Iterator[Mutation]:
    """Yield those of a module, relative to the root, whose operator stands in the line of its right operand."""
    source = (ROOT / file).read_bytes()
    lines = source.split(b"\n")
    for node in ast.walk(ast.parse(source)):
        operands: list[tuple[ast.AST, ast.expr, ast.expr]] = []
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            operands = [(node.ops[0], node.left, node.comparators[0])]
        elif isinstance(node, ast.BinOp):
            operands = [(node.op, node.left, node.right)]
        elif isinstance(node, ast.BoolOp):
            operands = [(node.op, a, b) for a, b in zip(node.values, node.values[1:], strict=False)]
        for operator, left, right in operands:
            old, columns = _SYMBOL.get(type(operator), ""), (left.end_col_offset or 0, right.col_offset)
            between = lines[right.lineno - 1][slice(*columns)] if left.end_lineno == right.lineno else b""
            if old and between.count(old.encode()) == 1:
                yield Mutation(file, right.lineno, columns, old)


def is_killed(mutation: Mutation, marker: str) -> bool:
    """Return whether one of its module's tests fails with it."""
    tests = sorted(map(str, select([mutation.file])))
    if not tests:
        return False
    path = ROOT / mutation.file
    source = path.read_bytes()
    path.write_bytes(mutation.applied(source))
    try:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", marker, *tests]
        done = subprocess.run(command, cwd=ROOT, timeout=_LIMIT, capture_output=True, check=False)
    except subprocess.TimeoutExpired:
        return True
    finally:
        path.write_bytes(source)
    return done.returncode not in (0, 5)  # 5: no test of the default tier


@click.command()
@click.option("--count", default=60, show_default=True, help="How many are drawn.")
@click.option("--seed", default=0, show_default=True, help="Of the draw.")
@click.argument("marker")
def main(count: int, seed: int, marker: str) -> None:
    """Draw mutations, and print which of them the tests with a MARKER kill."""
    if subprocess.check_output(["git", "status", "--porcelain", *ROOMS], cwd=ROOT):
        raise click.UsageError("the working tree differs from HEAD: commit first, so that nothing can be lost")
    files = sorted(path.relative_to(ROOT) for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    drawn = random.Random(seed).sample([m for file in files for m in mutations(file)], count)
    killed = 0
    for mutation in drawn:
        dies = is_killed(mutation, marker)
        killed += dies
        click.echo(f"{'killed' if dies else 'LIVES '} {mutation}")
    click.echo(f"{killed} of {count} killed")


if __name__ == "__main__":
    main()

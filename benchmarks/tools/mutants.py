"""Which small faults the tests let pass: `python -m benchmarks.tools.mutants --mutants 60 --seed 0`.

Each mutant is one change in one place of `care_core`: a comparison, an operator, a number, a negation. It is put into a
copy of the tree and tried by the unit tests that import the module, or where none does those that import its room. A
mutant on which a test fails, or that never ends, is killed. Prints every survivor and the score. Some survivors change
nothing that anybody could see (a limit that no value comes near): the list is for reading, the score for comparing.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from care_core.records import Record

ROOT = Path(__file__).parents[2]
ROOMS = ("diagnose", "causal", "extract", "configs")
LIMIT_S = 300.0
_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip


class Mutant(Record):
    """One module with one change in it."""

    module: Path
    """Relative to the root."""
    line: int
    change: str
    source: str


def places_in(path: Path) -> list[tuple[Path, int, int]]:
    """Every mutant of a module as (module, number of the node, which of the node's mutants)."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return [(path, index, n) for index, node in enumerate(ast.walk(tree)) for n, _ in enumerate(_mutated(node))]


def mutant_at(path: Path, index: int, number: int) -> Mutant:
    """The mutant of a place."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    node = list(ast.walk(tree))[index]
    before, line = ast.unparse(node), getattr(node, "lineno", 0)
    vars(node).update(list(_mutated(node))[number])
    return Mutant(path, line, f"{before}  ->  {ast.unparse(node)}", ast.unparse(tree))


def _mutated(node: ast.AST) -> Iterator[dict[str, object]]:
    """The fields of a node that make a mutant of it."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARISONS:
        yield {"ops": [_COMPARISONS[type(node.ops[0])](), *node.ops[1:]]}
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS and not isinstance(node.left, ast.Constant):
        yield {"op": _OPERATORS[type(node.op)]()}
    elif isinstance(node, ast.BoolOp):
        yield {"op": ast.Or() if isinstance(node.op, ast.And) else ast.And()}
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield {"op": ast.UAdd()}
    elif isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        yield {"value": node.value * 2 + 1 if isinstance(node.value, int) else node.value * 1.5 + 0.1}


def tests_of(module: Path) -> list[str]:
    """The tests that import a module, or else the unit tests that import its room."""
    name = ".".join(module.with_suffix("").parts)
    room = ".".join(module.parts[:2])
    own = re.compile(rf"from {name} import|from {room} import .*\b{module.stem}\b")
    places = [*(ROOT / "tests" / "unit").glob("test_*.py"), ROOT / "tests" / "integration" / "test_planted_cause.py"]
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(places)}
    found = [path for path, text in texts.items() if own.search(text)]
    found = found or [path for path, text in texts.items() if f"from {room}." in text]
    return [str(path.relative_to(ROOT)) for path in found]


def is_killed(mutant: Mutant, tree: Path) -> bool:
    """Whether a test notices, in the copy of the tree."""
    target = tree / mutant.module
    sound = target.read_text(encoding="utf-8")
    target.write_text(mutant.source, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    env = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        words = [*command, *tests_of(mutant.module)]
        return (
            subprocess.run(words, cwd=tree, env=env, capture_output=True, check=False, timeout=LIMIT_S).returncode != 0
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        target.write_text(sound, encoding="utf-8")


def sample(rooms: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """So many mutants of each room in turn, drawn at random over all its places."""
    rng = random.Random(seed)
    drawn: list[Mutant] = []
    for place, room in enumerate(rooms):
        paths = sorted((ROOT / "care_core" / room).glob("*.py"))
        every = [one for path in paths for one in places_in(path.relative_to(ROOT))]
        chosen = rng.sample(every, min(len(every), count // len(rooms) + (place < count % len(rooms))))
        drawn += [mutant_at(*one) for one in chosen]
    return drawn


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms", nargs="*", default=ROOMS)
    args = parser.parse_args()
    drawn = sample(args.rooms, args.mutants, args.seed)
    killed = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(
            ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "*.stamp", "__pycache__", ".*_cache")
        )
        for mutant in drawn:
            if is_killed(mutant, tree):
                killed += 1
            else:
                print(f"survived  {mutant.module}:{mutant.line}  {mutant.change}", flush=True)
    print(f"{killed} of {len(drawn)} mutants killed ({killed / len(drawn):.0%}), seed {args.seed}")


if __name__ == "__main__":
    main()

"""What the command line shows: rows of results, progress on a terminal, Ctrl-C as a flag."""

import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .planning.solver import Iteration

Rows = Sequence[tuple[str, ...]]


def print_rows(rows: Rows) -> None:
    """Print rows in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print('  '.join(f'{cell:<{w}}' for cell, w in zip(row, widths, strict=True)).rstrip())


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Give a function that tells whether Ctrl-C was pressed.

    IPOPT swallows KeyboardInterrupt, so that the signal sets a flag which is asked for at each
    iteration; a second one ends at once.
    """
    pressed: list[int] = []

    def handle(signum: int, frame: Any) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(signum)

    previous = signal.signal(signal.SIGINT, handle)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, previous)


@contextmanager
def iterations() -> "Iterator[Callable[['Iteration'], None] | None]":
    """Give a function that shows the solver's iterations on a terminal, None if there is none."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status('building') as status:

        def show(iteration: 'Iteration') -> None:
            status.update(
                f'iteration {iteration.number}: objective {iteration.objective:.6g}, '
                f'infeasibility {iteration.primal_infeasibility:.1e}'
            )

        yield show


@contextmanager
def busy(text: str) -> Iterator[None]:
    """Show on a terminal what is being worked on, and for how long."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn('{task.description}'), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(escape(text), total=None)
        yield

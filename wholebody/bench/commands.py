"""The command `wholebody bench`: measurements that the documentation quotes."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

bench = typer.Typer(no_args_is_help=True, help="Measurements that the documentation quotes.")

Hands = Annotated[bool, typer.Option(help="With the Dex3 hands, 43 joints, or without, 29.")]
SOLVERS = "compiled,daqp,quadprog,proxqp,piqp,osqp"


@bench.command()
def solvers(
    names: Annotated[str, typer.Option(help="QP solvers, or placo for the backend of that name.")] = SOLVERS,
    seconds: Annotated[float, typer.Option(help="Length of the lissajous, with its 2 s of blending in.")] = 10.0,
    hands: Hands = True,
    json_to: Annotated[str, typer.Option("--json", help="Also write the rows as JSON to a file.")] = "",
) -> None:
    """Stand, reach and follow the lissajous with each solver and no fallback. Exit code 1 if any failed or fell."""
    from models import g1
    from policy.scripted.library import lissajous, reach
    from wholebody.bench.solvers import HEADINGS, cells, standing, study
    from wholebody.episode.run import EpisodeConfig
    from wholebody.qp.solvers import available

    wanted = [name.strip() for name in names.split(",")]
    known = ("compiled", *available(), "placo")
    unknown = sorted(set(wanted) - set(known))
    if unknown:
        raise ValueError(f"unknown solvers {unknown}; available: {', '.join(known)}")
    typer.echo(_line(HEADINGS))
    typer.echo(_line(["---"] * len(HEADINGS)))
    spec, rows = g1(hands), []
    for name in wanted:
        for policy, length in ((standing(2.0), 2.0), (reach(0.5, 1.0), 4.0), (lissajous(), seconds)):
            rows += study(spec, name, [policy], seconds=length, episode=EpisodeConfig(hold=1.0))
            typer.echo(_line(cells(rows[-1])))
    if json_to:
        Path(json_to).write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")
    raise typer.Exit(1 if any(row.failures or row.fell for row in rows) else 0)


@bench.command()
def tick(
    row: Annotated[
        str, typer.Option(help="parity: the rows of others; default: ours; kinematic: no dynamics.")
    ] = "default",
    ticks: Annotated[int, typer.Option(help="Timed ticks; the script is repeated as often as needed.")] = 3000,
    hands: Hands = True,
    variant: Annotated[str, typer.Option(help="Limits that bind: none, torque, speed, friction or near.")] = "none",
) -> None:
    """Time one controller tick on the reach script and print one line of JSON."""
    from wholebody.bench.tick import CONFIGURATIONS, VARIANTS, bench_tick

    if row not in CONFIGURATIONS or ticks < 1:
        raise ValueError(f"row '{row}' with {ticks} ticks; rows: {', '.join(CONFIGURATIONS)}; at least one tick")
    if variant not in VARIANTS:
        raise ValueError(f"unknown variant '{variant}'; available: {', '.join(VARIANTS)}")
    typer.echo(json.dumps(bench_tick(row, ticks, hands=hands, variant=variant)))


@bench.command()
def loop(
    policy: Annotated[str, typer.Option(help="Scripted policy to follow.")] = "lissajous",
    seconds: Annotated[float, typer.Option(help="Simulated time after a second of standing.")] = 10.0,
    hands: Hands = True,
) -> None:
    """Time controller and 2 ms physics together, planning apart, and print one line of JSON."""
    from wholebody.bench.loop import bench_loop

    if not 0.0 < seconds < float("inf"):
        raise ValueError(f"{seconds} s is no time to follow a policy for; it must be finite and above 0")
    typer.echo(json.dumps(bench_loop(policy, seconds, hands=hands)))


@bench.command()
def memory(
    policy: Annotated[str, typer.Option(help="Scripted policy to follow, over and over again.")] = "wave",
    ticks: Annotated[int, typer.Option(help="How many, rounded up to whole runs.")] = 100_000,
    hands: Hands = True,
) -> None:
    """Print how much memory controller and plant take after one run and after many, as one line of JSON."""
    from wholebody.bench.loop import bench_memory

    if ticks < 1:
        raise ValueError(f"{ticks} ticks; at least one is needed")
    typer.echo(json.dumps(bench_memory(policy, ticks, hands=hands)))


def _line(cells: tuple[str, ...] | list[str]) -> str:
    return f"| {' | '.join(cells)} |"

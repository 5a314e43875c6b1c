"""Measurements of `wholebody bench`: ticks, loops, memory, solvers.

Begin with `wholebody.bench.commands`; how a tick is timed is in `wholebody.bench.tick.bench_tick`.
"""

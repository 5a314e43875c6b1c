"""The kernels that Python calls, each compiled on its first call, for all that it calls in turn."""

from __future__ import annotations

from wholebody.jit.entry import Entry
from wholebody.planning.trajopt.kernels import centroidal, linearise, newton, proximity, spline_offset, warm_start
from wholebody.planning.trajopt.kernels import cost as objective

place = Entry(linearise.place)
rates = Entry(linearise.rates)
measure = Entry(proximity.measure)
describe = Entry(proximity.describe)
cost = Entry(objective.cost)
assemble = Entry(objective.assemble)
step = Entry(newton.step)
follow = Entry(warm_start.follow)
moved = Entry(warm_start.moved)
bend = Entry(spline_offset.bend)
momenta = Entry(centroidal.momenta)

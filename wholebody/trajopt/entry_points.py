"""The kernels that Python calls, each compiled on its first call together with all that it calls in turn."""

from __future__ import annotations

from wholebody.jit.entry import Entry
from wholebody.trajopt.kernels import (
    centroidal as _centroidal,
)
from wholebody.trajopt.kernels import (
    cost as _cost,
)
from wholebody.trajopt.kernels import (
    linearise,
    newton,
    proximity,
)
from wholebody.trajopt.kernels import (
    spline as _spline,
)
from wholebody.trajopt.kernels import (
    warm_start as _warm_start,
)

place = Entry(linearise.place)
rates = Entry(linearise.rates)
between = Entry(linearise.between)
measure = Entry(proximity.measure)
describe = Entry(proximity.describe)
cost = Entry(_cost.cost)
assemble = Entry(_cost.assemble)
step = Entry(newton.step)
warm_start = Entry(_warm_start.warm_start)
follow_rows = Entry(_warm_start.follow_rows)
take_step = Entry(_warm_start.take_step)
spline_offset = Entry(_spline.spline_offset)
centroidal = Entry(_centroidal.centroidal)

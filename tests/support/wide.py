"""Cases that widen a test: `make regression` runs them, `make test` has the sharpest alone."""

import pytest


def wide(*cases):
    """Cases of a parametrised test for the long studies; several parameters as a tuple."""
    as_tuples = (case if isinstance(case, tuple) else (case,) for case in cases)
    return [pytest.param(*case, marks=pytest.mark.regression) for case in as_tuples]

"""A log that a stranger at the other end of a wire cannot fill."""

from __future__ import annotations

import logging
from threading import Lock
from time import monotonic
from typing import Any

BURST = 10
"""Messages that may come at once [no unit]; chosen: all that a person reads of one event."""
PERIOD = 20.0
"""Time after which one more may come [s]; chosen: 1,500 lines in five minutes of tracebacks, not 35,000."""


class SparingLog(logging.LoggerAdapter):
    """A logger's warnings and errors, a few at once and then one a period; the next one says how many were left out.

    Args:
        logger: Who logs.
        burst: Messages that may come at once.
        period: Time after which one more may come [s].
    """

    def __init__(self, logger: logging.Logger, burst: int = BURST, period: float = PERIOD) -> None:
        super().__init__(logger, {})
        self._burst, self._period, self._guard = burst, period, Lock()
        self._room, self._since, self._left_out = float(burst), monotonic(), 0

    def log(self, level: int, msg: object, *args: Any, **kwargs: Any) -> None:
        """Log a message, or count it where there were too many."""
        if level < logging.WARNING:
            super().log(level, msg, *args, **kwargs)
            return
        with self._guard:
            now = monotonic()
            self._room = min(self._room + (now - self._since) / self._period, self._burst)
            self._since = now
            if self._room < 1.0:
                self._left_out += 1
                return
            self._room -= 1.0
            left_out, self._left_out = self._left_out, 0
        if left_out:
            super().log(level, "%d messages were left out: they came too fast", left_out)
        super().log(level, msg, *args, **kwargs)

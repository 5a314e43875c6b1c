"""The one thread in which a served policy is called."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from queue import SimpleQueue
from time import monotonic
from traceback import format_exc
from typing import Any

from policy.errors import PolicyError

LOOK_INTERVAL = 0.05
"""How often to look whether the client has hung up while the policy computes [s]."""


class PolicyFailure(Exception):
    """What a policy raised, as the text that its client gets."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text


class PolicyWorker:
    """The thread that calls the policy."""

    def __init__(self) -> None:
        self._jobs: SimpleQueue[tuple[Callable[[], Any], Future] | None] = SimpleQueue()
        self._running: tuple[Future, float] | None = None
        threading.Thread(target=self._run, name="served policy", daemon=True).start()

    def run(self, call: Callable[[], Mapping[str, Any]], wanted: Callable[[], bool]) -> Mapping[str, Any]:
        """Result of a call.

        Args:
            call: What to call.
            wanted: Looked at while it runs; once it is false, no client waits any longer.

        Raises:
            PolicyError: If a call from before still runs, or the result is no longer wanted.
            PolicyFailure: If the call raised.
        """
        if self._running is not None and not self._running[0].done():
            since = monotonic() - self._running[1]
            raise PolicyError(
                f"the policy is busy: it computes since {since:.1f} s for a request that no client waits for"
            )
        future: Future = Future()
        self._running = (future, monotonic())
        self._jobs.put((call, future))
        while True:
            try:
                return future.result(LOOK_INTERVAL)
            except TimeoutError as error:
                if not wanted():
                    raise PolicyError("the client has hung up") from error

    def close(self) -> None:
        """End the thread after the running call; does not wait for it."""
        self._jobs.put(None)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            call, future = job
            try:
                future.set_result(call())
            except BaseException:  # noqa: BLE001 - SystemExit of a policy too goes to the client
                future.set_exception(PolicyFailure(format_exc()))

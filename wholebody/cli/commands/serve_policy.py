"""``wholebody serve-policy``: a policy over a websocket."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from signal import SIGTERM, default_int_handler, signal
from typing import Annotated, Any

from typer import Argument, Option

from wholebody.cli.console import complain, say
from wholebody.cli.options import SOURCES, AssumeSpec, Fps, RealTimeChunking, RenameMap, Sampling, completed_script
from wholebody.cli.sources import layout_named, open_source, require_blind


@dataclass(frozen=True)
class ServingOptions(Sampling):
    """How the network of a checkpoint is loaded, and what it is asked for."""

    task: Annotated[str, Option(help="Checkpoint: task where the client gives none.")] = ""
    dtype: Annotated[str, Option(help="Checkpoint: float32 or bfloat16; as saved if not given.")] = ""
    real_time_chunking: RealTimeChunking = False
    allow_random_weights: Annotated[bool, Option(help="Checkpoint: go on without weights, for timing.")] = False

    def choices(self) -> dict[str, Any]:
        """Fields of `Network` by name."""
        return super().choices() | {
            "task": self.task,
            "dtype": self.dtype or None,
            "rtc": self.real_time_chunking,
            "allow_random_weights": self.allow_random_weights,
        }


def serve_policy(
    *,
    source: Annotated[
        str, Argument(help=f"Folder of a LeRobot checkpoint. {SOURCES}", autocompletion=completed_script)
    ],
    host: Annotated[str, Option(help="Address to listen on; 0.0.0.0: every network.")] = "127.0.0.1",
    port: Annotated[int, Option(help="Port; 0: any free one.")] = 8000,
    served: ServingOptions,
    fps: Fps = None,
    assume_spec: AssumeSpec = "",
    rename_map: RenameMap = "",
) -> None:
    """Serve a policy over a websocket to one robot at a time. Speaks openpi's protocol; ends with Ctrl-C."""
    from policy.remote.openpi import KeyMap
    from policy.remote.server import LOOPBACK, PolicyServer

    keys = KeyMap.named(rename_map)

    if Path(source).is_dir():
        from policy.lerobot.policy import LeRobotPolicy

        policy = LeRobotPolicy.from_pretrained(source, assume_spec=layout_named(assume_spec), **served.choices())
        for finding in policy.warnings:
            complain(finding.sentence)
    else:
        policy = open_source(source, fps, layout_named(assume_spec))
        require_blind({source: policy}, "serve-policy")
    with PolicyServer(policy, host=host, port=port, keys=keys) as server, suppress(KeyboardInterrupt):
        # Containers and service managers end a program by this signal, as soon as it has said that it is there.
        signal(SIGTERM, default_int_handler)
        say(
            f"serving '{server.metadata['name']}' ({policy.spec.id}) at {server.uri}",
            *(f"  clients of openpi send '{key}', {meaning}" for key, meaning in server.metadata["request"].items()),
        )
        if host not in (LOOPBACK, "localhost", "::1"):
            complain(f"everyone who reaches {host} can use the policy: no password, no encryption")
        server.wait()

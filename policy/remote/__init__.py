"""Policies on another computer, over openpi's websocket protocol.

Begin with `policy.remote.client.RemotePolicy` and, on the other computer, `policy.remote.server.PolicyServer`.
"""

"""Policies on another computer, over openpi's websocket protocol."""

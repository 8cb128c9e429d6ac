"""A page served on this machine: server.py (HTTP and web socket) and bridge.py (commands of meshcat programs)."""

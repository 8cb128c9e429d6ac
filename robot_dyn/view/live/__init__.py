"""A live page: the server on 127.0.0.1 and the bridge by which meshcat programs draw into it."""

"""The motion as y' = f(t, y): the state equation, its linearisation, where it is smooth."""

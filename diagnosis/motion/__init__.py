"""How the joints move in these runs, and so what the runs can tell."""

"""How the readers stand damaged files: `planetpose benchmark fuzz`."""

"""How fast the program is on this machine: `planetpose benchmark`, which the commands of other rooms are part of."""
